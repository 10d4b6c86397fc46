"""Statistics of a tree's nodes: ticks, successes, failures, skips, and the time in each state."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tree import StateChanges, Tree
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


@dataclass
class NodeStatistics:
    """Statistics of one node; times in seconds of the tree's clock."""

    path: str
    ticks: int = 0
    transitions: int = 0
    successes: int = 0
    failures: int = 0
    skips: int = 0
    last_result: int = IDLE
    last_change: float = 0.0
    seconds: dict[int, float] = field(default_factory=lambda: {IDLE: 0.0, RUNNING: 0.0, SUCCESS: 0.0, FAILURE: 0.0})


class TreeObserver:
    """Collects ``NodeStatistics`` between ``open`` and ``close``; a context manager.

    Counting ticks and skips needs a callback on every node; ``count_ticks=False`` leaves them at zero and costs less.
    """

    def __init__(self, tree: Tree, *, count_ticks: bool = True) -> None:
        self._tree = tree
        self._states: dict[int, int] = {}
        self.statistics: dict[int, NodeStatistics] = {}
        self._count_ticks = count_ticks

    def __getitem__(self, path: str) -> NodeStatistics:
        """Return the statistics of the node with this path.

        Raises:
            KeyError: there is none.
        """
        return self.statistics[self._tree.node(path).uid]

    def open(self) -> TreeObserver:
        """Start listening."""
        now = self._tree.clock.now()
        self._states = {node.uid: node.state for node in self._tree.nodes}
        self.statistics = {node.uid: NodeStatistics(node.path, last_change=now) for node in self._tree.nodes}
        if self._count_ticks:
            for node in self._tree.nodes:
                node.add_post_tick(self._count, rebind=False)
            self._tree.rebind()
        self._tree.subscribe(self._listen)
        return self

    def close(self) -> None:
        """Stop listening."""
        self._tree.unsubscribe(self._listen)
        now = self._tree.clock.now()
        for uid, statistics in self.statistics.items():
            statistics.seconds[self._states.get(uid, IDLE)] += now - statistics.last_change
            statistics.last_change = now
        if self._count_ticks:
            for node in self._tree.nodes:
                node.remove_hook(self._count, rebind=False)
            self._tree.rebind()

    def _count(self, node: Node, status: int) -> None:
        statistics = self.statistics[node.uid]
        statistics.ticks += 1
        if status == SKIPPED:
            statistics.skips += 1

    def _listen(self, changes: StateChanges) -> None:
        stamp = changes.stamp
        for uid, state in changes:
            previous, self._states[uid] = self._states.get(uid, IDLE), state
            statistics = self.statistics[uid]
            statistics.transitions += 1
            statistics.seconds[previous] += stamp - statistics.last_change
            statistics.last_change = stamp
            if state == SUCCESS:
                statistics.successes += 1
                statistics.last_result = SUCCESS
            elif state == FAILURE:
                statistics.failures += 1
                statistics.last_result = FAILURE

    def __enter__(self) -> TreeObserver:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()
