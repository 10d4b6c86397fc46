"""The tree of pick_place_table.xml, written in Python: the same nodes, the same behaviour.

bestman-bt run pick_place_table_python --task pick_place_table
"""

from __future__ import annotations

from behaviours.pick_and_place import pick_and_place, survey
from bestman_bt.engine import Node, Sequence, SubTree


def build() -> Node:
    """Take one of the things on a table and put it elsewhere, where there is room."""
    entries = {name: f"{{{name}}}" for name in ("object", "source", "target", "goal")}
    return Sequence(
        "pick_place_table",
        [
            SubTree(survey, tree_id="Survey", name="survey", surface="{source}"),
            SubTree(pick_and_place, tree_id="PickAndPlace", name="move", **entries),
        ],
    )
