"""What happened, told once: leaves that start, succeed and fail; a condition checked at every tick is no news."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.node_states import LOOKS, NO, NodeLook, ended_by
from bestman_bt.visualization.tree_description import DescribedNode, NodeTransition, TreeDescription


@dataclass(frozen=True)
class NodeEvent:
    """``node`` came to ``state`` at ``stamp`` seconds; ``message``: why, in words; ``ends``: with it the tree."""

    stamp: float
    node: DescribedNode
    state: int
    message: str
    ends: bool = False

    @property
    def look(self) -> NodeLook:
        """How to show it: a condition that is not so has answered, and not failed."""
        return NO if self.node.condition and self.state == FAILURE and not self.ends else LOOKS[self.state]

    def __str__(self) -> str:
        look = self.look
        message = f": {self.message}" if self.message else ""
        return f"[{self.stamp:7.2f} s] {look.icon} {node_label(self.node)} {look.word}{message}"


class NodeEvents:
    """Turns state changes of leaves into events; a leaf that repeats itself is told once."""

    def __init__(self, tree: TreeDescription) -> None:
        self._tree = tree
        self._leaves = {leaf.uid for leaf in tree.leaves()}
        self._told: dict[int, tuple[int, str]] = {}

    def of(self, transitions: Iterable[NodeTransition]) -> list[NodeEvent]:
        """The events in a batch of changes, and how the root ended."""
        events = []
        transitions = list(transitions)
        last = ended_by(self._tree, transitions)
        for transition in transitions:
            node = self._tree.node(transition.uid)
            told = self._told.get(node.uid)
            if transition.state not in (RUNNING, SUCCESS, FAILURE):
                if transition.state == IDLE and told and told[0] == RUNNING:
                    del self._told[node.uid]
                continue
            is_result_of_root = node is self._tree.root and transition.state != RUNNING
            if node.uid not in self._leaves and not is_result_of_root:
                continue
            now = (transition.state, transition.message if transition.state != RUNNING else "")
            if now != told:
                self._told[node.uid] = now
                events.append(NodeEvent(transition.stamp, node, transition.state, transition.message, node.uid == last))
        return events
