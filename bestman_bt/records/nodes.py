"""The nodes of a run as one list: the main tree's, and below their leaf those of trees loaded while it ran."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from bestman_bt.records.events import MAIN_TREE, EventError, TreeEvent

MAX_NODES = 100_000


class NodeList:
    """``document`` lists what the page shows; uids count on from tree to tree."""

    def __init__(self) -> None:
        self.document: list[dict[str, Any]] = []
        self._ranges: dict[int, tuple[int, int]] = {}

    def __len__(self) -> int:
        return len(self.document)

    def path_of(self, uid: int) -> str:
        """A node's path; its number where there is no such node."""
        return str(self.document[uid - 1]["path"]) if 0 < uid <= len(self.document) else f"#{uid}"

    def range_of(self, tree: int) -> tuple[int, int]:
        """What to add to the uids of a tree, and how many nodes it has; EventError for an unknown one."""
        if tree not in self._ranges:
            raise EventError(f"no tree {tree} was told")
        return self._ranges[tree]

    def inside(self, uid: int) -> tuple[int, int]:
        """The tree that a node belongs to, and its uid there; EventError for an unknown one."""
        for tree, (offset, count) in self._ranges.items():
            if offset < uid <= offset + count:
                return tree, uid - offset
        raise EventError(f"there is no node {uid}")

    def add(self, event: TreeEvent) -> list[tuple[int, bool, bool]]:
        """Add a tree; returns (uid, is a leaf, is a subtree) of each new node.

        A tree that was told before is not added again: whoever subscribes anew is told all of them.

        Raises:
            EventError: it does not fit what was told before, or its nodes are not in order.
        """
        if event.tree in self._ranges:
            if self._ranges[event.tree][1] != len(event.nodes):
                raise EventError(f"the tree {event.tree} has other nodes than before")
            return []
        if not event.nodes:
            raise EventError(f"the tree {event.tree} has no nodes")
        offset = len(self.document)
        if offset + len(event.nodes) > MAX_NODES:
            raise EventError(f"more than {MAX_NODES} nodes")
        under = None
        if event.under is not None:
            main_offset, count = self.range_of(MAIN_TREE)
            if not 0 < event.under <= count:
                raise EventError(f"the tree {event.tree} is under the node {event.under}, which is not there")
            under = main_offset + event.under
        parents = set()
        for number, node in enumerate(event.nodes, 1):
            if node.uid != number or (node.parent is not None and not 0 < node.parent < number):
                raise EventError(f"node {number} of the tree {event.tree} is out of order")
            parents.add(node.parent)
        for node in event.nodes:
            parent = under if node.parent is None else offset + node.parent
            self.document.append(asdict(node) | {"uid": offset + node.uid, "parent": parent})
        self._ranges[event.tree] = (offset, len(event.nodes))
        return [(offset + node.uid, node.uid not in parents, node.category == "subtree") for node in event.nodes]
