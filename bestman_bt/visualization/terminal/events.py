"""What happened, told once: leaves that start, succeed and fail; a condition checked at every tick is no news."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine.status import IDLE, RUNNING, SKIPPED
from bestman_bt.records.events import DescribedNode, StatesEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.records.palette import LOOKS, Look
from bestman_bt.visualization.node_labels import node_label


@dataclass(frozen=True)
class NodeEvent:
    """``node`` came to ``state`` at ``time`` seconds; ``message``: why, in words."""

    time: float
    node: DescribedNode
    state: int
    message: str

    @property
    def look(self) -> Look:
        """How to show it."""
        return LOOKS[self.state]

    def __str__(self) -> str:
        look = self.look
        message = f": {self.message}" if self.message else ""
        return f"[{self.time:7.2f} s] {look.icon} {node_label(self.node)} {look.word}{message}"


class NodeEvents:
    """Turns state changes of leaves into events; a leaf that repeats itself is told once."""

    def __init__(self, history: RunHistory) -> None:
        self._history = history
        self._told: dict[int, tuple[int, str]] = {}

    def of(self, event: StatesEvent) -> list[NodeEvent]:
        """What is told of the changes of a tick, and how the root of their tree ended."""
        events = []
        offset, _ = self._history.nodes.range_of(event.tree)
        for change in self._history.shown(event):
            node, state = self._history.nodes.node(change.uid), change.status
            told = self._told.get(node.uid)
            if state in (IDLE, SKIPPED):
                if state == IDLE and told and told[0] == RUNNING:
                    del self._told[node.uid]
                continue
            is_result_of_root = node.uid == offset + 1 and state != RUNNING
            if not (node.is_leaf or is_result_of_root):
                continue
            message = event.messages.get(node.uid - offset, "")
            now = (state, message if state != RUNNING else "")
            if now != told:
                self._told[node.uid] = now
                events.append(NodeEvent(event.time, node, state, message))
        return events
