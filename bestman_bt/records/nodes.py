"""The nodes of a run as one list: those of the main tree, and of trees loaded at run time below the loading leaf."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import overload

from bestman_bt.records.events import MAIN_TREE, DescribedNode, EventError, TreeEvent

MAX_NODES = 100_000


class NodeList(Sequence[DescribedNode]):
    """A list of nodes with consecutive uids over all trees; those of the first tree are its own."""

    def __init__(self) -> None:
        self._nodes: list[DescribedNode] = []
        self._children: list[list[int]] = [[]]
        self._ranges: dict[int, tuple[int, int]] = {}

    def __len__(self) -> int:
        return len(self._nodes)

    @overload
    def __getitem__(self, index: int) -> DescribedNode: ...
    @overload
    def __getitem__(self, index: slice) -> list[DescribedNode]: ...
    def __getitem__(self, index: int | slice) -> DescribedNode | list[DescribedNode]:
        return self._nodes[index]

    def node(self, uid: int) -> DescribedNode:
        """Return the node with this uid. Raises EventError if there is none."""
        if not 0 < uid <= len(self._nodes):
            raise EventError(f"there is no node {uid}")
        return self._nodes[uid - 1]

    def children(self, uid: int) -> list[DescribedNode]:
        """Return the children of a node, left to right; for a leaf, the roots of the trees that it ticks."""
        return [self._nodes[child - 1] for child in self._children[self.node(uid).uid]]

    def depth(self, uid: int) -> int:
        """Return the number of ancestors of a node."""
        depth, node = 0, self.node(uid)
        while node.parent is not None:
            depth, node = depth + 1, self.node(node.parent)
        return depth

    def depth_first(self) -> Iterator[DescribedNode]:
        """Yield all nodes depth first, left to right."""
        pending = [node for node in reversed(self._nodes) if node.parent is None]
        while pending:
            node = pending.pop()
            yield node
            pending += reversed(self.children(node.uid))

    def leaves(self) -> list[DescribedNode]:
        """Return the nodes without any below them, in the order of reading."""
        return [node for node in self.depth_first() if not self._children[node.uid]]

    def path_of(self, uid: int) -> str:
        """Return a node's path, or its number if it is unknown."""
        return self._nodes[uid - 1].path if 0 < uid <= len(self._nodes) else f"#{uid}"

    @property
    def trees(self) -> list[int]:
        """Return the numbers of the known trees."""
        return list(self._ranges)

    def range_of(self, tree: int) -> tuple[int, int]:
        """Return the uid offset and the number of nodes of a tree. Raises EventError for an unknown tree."""
        if tree not in self._ranges:
            raise EventError(f"unknown tree {tree}")
        return self._ranges[tree]

    def inside(self, uid: int) -> tuple[int, int]:
        """Return the tree that a node belongs to, and its uid in that tree. Raises EventError for an unknown node."""
        for tree, (offset, count) in self._ranges.items():
            if offset < uid <= offset + count:
                return tree, uid - offset
        raise EventError(f"there is no node {uid}")

    def add(self, event: TreeEvent) -> list[DescribedNode]:
        """Add a tree; returns its nodes with their uids in this list.

        A known tree is not added again, because new subscribers receive all trees.

        Raises:
            EventError: it contradicts earlier events, or its nodes are not in order.
        """
        if event.tree in self._ranges:
            if self._ranges[event.tree][1] != len(event.nodes):
                raise EventError(f"the tree {event.tree} has different nodes than before")
            return []
        if not event.nodes:
            raise EventError(f"the tree {event.tree} has no nodes")
        offset = len(self._nodes)
        if offset + len(event.nodes) > MAX_NODES:
            raise EventError(f"more than {MAX_NODES} nodes")
        under = None
        if event.under is not None:
            main_offset, count = self.range_of(MAIN_TREE)
            if not 0 < event.under <= count:
                raise EventError(f"the tree {event.tree} is under the node {event.under}, which does not exist")
            under = main_offset + event.under
        _check_order(event)
        added = [
            replace(node, uid=offset + node.uid, parent=under if node.parent is None else offset + node.parent)
            for node in event.nodes
        ]
        self._nodes += added
        self._children += [[] for _ in added]
        for node in added:
            if node.parent is not None:
                self._children[node.parent].append(node.uid)
        self._ranges[event.tree] = (offset, len(added))
        return added


def _check_order(event: TreeEvent) -> None:
    for number, node in enumerate(event.nodes, 1):
        if node.uid != number or (node.parent is not None and not 0 < node.parent < number):
            raise EventError(f"node {number} of the tree {event.tree} is out of order")
