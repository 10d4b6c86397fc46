"""Coverage of a tree by runs: nodes, results, recoveries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from bestman_bt.engine.controls import Fallback, ReactiveFallback, RecoveryNode, TryCatch
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.reachability import possible_results
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS

_FALLBACKS = (Fallback, ReactiveFallback, RecoveryNode, TryCatch)


@dataclass(frozen=True)
class NodeUse:
    """How often a node started, succeeded, failed and was halted."""

    began: int = 0
    succeeded: int = 0
    failed: int = 0
    halted: int = 0


@dataclass
class Coverage:
    """Counts of state changes, by node number, over all added runs."""

    tree: Tree
    runs: int = 0
    counts: Counter[tuple[int, int]] = field(default_factory=Counter)
    halts: Counter[int] = field(default_factory=Counter)
    _states: dict[int, int] = field(default_factory=dict)

    def add(self, changes: Iterable[tuple[int, int]]) -> None:
        """Count the changes of a whole run, each (number of the node, new state)."""
        states: dict[int, int] = {}
        self.runs += 1
        for uid, state in changes:
            before = states.get(uid, IDLE)
            if state == IDLE:
                self.halts[uid] += before == RUNNING
            else:
                self.counts[uid, state] += 1
                self.counts[uid, IDLE] += before == IDLE
            states[uid] = state

    def of(self, node: Node) -> NodeUse:
        """Return the counts of a node."""
        counts, uid = self.counts, node.uid
        return NodeUse(counts[uid, IDLE], counts[uid, SUCCESS], counts[uid, FAILURE], self.halts[uid])

    @property
    def never_ticked(self) -> list[Node]:
        """Nodes that never started, only the topmost of each branch."""
        return [node for node in self._idle() if not (isinstance(node.parent, Node) and not self.of(node.parent).began)]

    @property
    def share(self) -> float:
        """The fraction of nodes that have started at least once, 0 to 1."""
        return 1.0 - len(self._idle()) / len(self.tree.nodes)

    @property
    def never_failed(self) -> list[Node]:
        """Leaves that have ended but never failed, although they can fail."""
        return self._without(FAILURE)

    @property
    def never_succeeded(self) -> list[Node]:
        """Leaves that have started but never succeeded, although they can succeed."""
        return self._without(SUCCESS)

    @property
    def never_left(self) -> list[Node]:
        """Nodes that have started but never ended by themselves."""
        uses = [(node, self.of(node)) for node in self.tree.nodes]
        return [node for node, use in uses if use.began and not use.succeeded + use.failed]

    @property
    def unused_recoveries(self) -> list[Node]:
        """Fallbacks and recovery nodes that have started, but whose second child, the recovery, never has."""
        found = [node for node in self.tree.nodes if isinstance(node, _FALLBACKS) and self.of(node).began]
        return [node for node in found if len(node.nodes_below()) > 1 and not self.of(node.nodes_below()[1]).began]

    def _idle(self) -> list[Node]:
        return [node for node in self.tree.nodes if not self.counts[node.uid, IDLE]]

    def _without(self, status: int) -> list[Node]:
        leaves = [node for node in self.tree.nodes if not node.children and self.counts[node.uid, IDLE]]
        return [leaf for leaf in leaves if not self.counts[leaf.uid, status] and status in possible_results(leaf)]
