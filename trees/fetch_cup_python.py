"""The tree of fetch_cup.xml, written in Python: the same nodes, the same behaviour.

bestman-bt run fetch_cup_python --task fetch_cup
"""

from __future__ import annotations

from behaviours.pick_and_place import pick_and_place
from bestman_bt.engine import Node, SubTree


def build() -> Node:
    """Fetch an object from one surface and place it on another, at a goal in the map frame."""
    entries = {name: f"{{{name}}}" for name in ("object", "source", "target", "goal")}
    return SubTree(pick_and_place, tree_id="PickAndPlace", name="fetch", **entries)
