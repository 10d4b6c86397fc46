"""What a view needs to know of a tree: its nodes with their parents, and what changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bestman_bt.visualization.errors import VisualizationError


@dataclass(frozen=True)
class DescribedNode:
    """A node of a tree: ``uid`` unique in the tree, ``type`` as in XML, ``parent`` the parent's uid (None: root).

    ``condition``: it asks, and its FAILURE is the answer no.
    """

    uid: int
    name: str
    type: str
    parent: int | None
    condition: bool = False


@dataclass(frozen=True)
class NodeTransition:
    """Node ``uid`` went to ``state`` (a constant of ``bestman_bt.engine.status``) at ``stamp`` seconds.

    ``message``: why, in words: the error of a failed leaf or the feedback of a running one.
    """

    uid: int
    state: int
    stamp: float
    message: str = ""


class TreeDescription:
    """The nodes of one tree, parents before their children, with the relations between them."""

    def __init__(self, nodes: Sequence[DescribedNode]) -> None:
        """Check that there is one root, that uids are unique and that parents come first."""
        self.nodes = tuple(nodes)
        self._by_uid: dict[int, DescribedNode] = {}
        self._children: dict[int, list[DescribedNode]] = {}
        for position, node in enumerate(self.nodes):
            if node.uid in self._by_uid:
                raise VisualizationError(f"tree description: uid {node.uid} of {node.name!r} is used twice")
            if (node.parent is None) != (position == 0):
                raise VisualizationError(
                    f"tree description: the first node, and no other, should have no parent; "
                    f"node {position} {node.name!r} has parent {node.parent}"
                )
            if node.parent is not None:
                if node.parent not in self._by_uid:
                    raise VisualizationError(
                        f"tree description: {node.name!r} has parent {node.parent}, which no earlier node has as uid"
                    )
                self._children[node.parent].append(node)
            self._by_uid[node.uid] = node
            self._children[node.uid] = []
        if not self.nodes:
            raise VisualizationError("tree description: a tree should have at least one node")

    @property
    def root(self) -> DescribedNode:
        """The node without a parent."""
        return self.nodes[0]

    def __len__(self) -> int:
        return len(self.nodes)

    def __contains__(self, uid: object) -> bool:
        return uid in self._by_uid

    def node(self, uid: int) -> DescribedNode:
        """The node with ``uid``; VisualizationError if there is none."""
        if uid not in self._by_uid:
            raise VisualizationError(f"the tree {self.root.name!r} has no node with uid {uid}")
        return self._by_uid[uid]

    def children(self, uid: int) -> Sequence[DescribedNode]:
        """The children of a node, left to right."""
        self.node(uid)
        return self._children[uid]

    def leaves(self) -> list[DescribedNode]:
        """The nodes without children, left to right."""
        return [node for node in self.depth_first() if not self._children[node.uid]]

    def depth(self, uid: int) -> int:
        """Number of ancestors."""
        node, depth = self.node(uid), 0
        while node.parent is not None:
            node, depth = self._by_uid[node.parent], depth + 1
        return depth

    def depth_first(self) -> Iterator[DescribedNode]:
        """All nodes in the order in which a tree is read: a parent, then its children left to right."""
        pending = [self.root]
        while pending:
            node = pending.pop()
            yield node
            pending.extend(reversed(self._children[node.uid]))
