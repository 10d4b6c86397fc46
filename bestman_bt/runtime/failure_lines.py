"""One line of the log for each failure of a leaf: which node, with what code, and why in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from behaviours.failure import NodeFailure
from bestman_bt.engine import FAILURE, Tree
from bestman_bt.records.described_tree import category_of


class FailureLines:
    """Puts together what the tree and what the skills tell; what conditions deny is an answer, and no failure.

    ``told``: what skills told, oldest first; it grows while the run goes on.
    """

    def __init__(self, told: Sequence[NodeFailure] = ()) -> None:
        self._told = told
        self._read = len(told)

    def of(self, tree: Tree, uids: Iterable[int]) -> list[NodeFailure]:
        """The lines of leaves that have just failed."""
        new = {failure.node: failure for failure in self._told[self._read :]}
        self._read = len(self._told)
        lines = []
        for uid in uids:
            node = tree.nodes[uid - 1]
            failure = new.get(node.path)
            if failure is not None:
                lines.append(failure)
            else:
                lines.append(NodeFailure(node.path, "", node.feedback_message or f"{node.type_id} failed", node.where))
        return lines


def failure_codes(tree: Tree) -> frozenset[int]:
    """The entries of ``StateChanges.codes`` that say that an action failed."""
    return frozenset(
        node.uid * 8 + FAILURE for node in tree.nodes if not node.children and category_of(node) == "action"
    )
