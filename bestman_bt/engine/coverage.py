"""Coverage of a tree by runs: nodes, results, recoveries; and the results that a node can have at all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final

from bestman_bt.engine import controls, decorators
from bestman_bt.engine.controls import Fallback, ReactiveFallback, RecoveryNode, TryCatch
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.leaves.base import AlwaysFailure, AlwaysSuccess, Leaf
from bestman_bt.engine.leaves.script import Script, TestNode
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS

_FALLBACKS = (Fallback, ReactiveFallback, RecoveryNode, TryCatch)


@dataclass(frozen=True)
class NodeUse:
    """Numbers of starts, successes, failures and halts of a node."""

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
        """Nodes that never started; of each branch, only the topmost."""
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
        """Nodes that have started but were always halted before their end; not those whose children were all
        skipped.
        """
        uses = [(node, self.of(node)) for node in self.tree.nodes]
        unfinished = [node for node, use in uses if use.began and not use.succeeded + use.failed]
        return [node for node in unfinished if self._began_at_a_leaf(node)]

    def _began_at_a_leaf(self, node: Node) -> bool:
        below = node.nodes_below()
        return any(map(self._began_at_a_leaf, below)) if below else self.counts[node.uid, IDLE] > 0

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


_ALL: Final = frozenset((RUNNING, SUCCESS, FAILURE, SKIPPED))
_DONE: Final = frozenset((SUCCESS, FAILURE))
_CONDITIONS: Final = (("_failureIf", FAILURE), ("_successIf", SUCCESS), ("_skipIf", SKIPPED), ("_while", SKIPPED))
_SEQUENCE_NODES: Final = (
    controls.Sequence,
    controls.AsyncSequence,
    controls.SequenceWithMemory,
    controls.ReactiveSequence,
)
_FALLBACK_NODES: Final = (controls.Fallback, controls.AsyncFallback, controls.ReactiveFallback)


def possible_results(node: Node) -> frozenset[int]:
    """Return the statuses that a tick of ``node`` may return, judged only from the tree."""
    results = set(_core_results(node))
    for attribute, status in _CONDITIONS:
        if attribute in node.attributes:
            results.add(status)
    return frozenset(results)


def _core_results(node: Node) -> frozenset[int]:
    if isinstance(node, (AlwaysSuccess, Script)):
        return frozenset((SUCCESS,))
    if isinstance(node, AlwaysFailure):
        return frozenset((FAILURE,))
    if isinstance(node, decorators.Decorator):
        return _decorated(node, possible_results(node.child))
    if isinstance(node, _SEQUENCE_NODES):
        return _in_order(node, go=SUCCESS, stop=FAILURE)
    if isinstance(node, _FALLBACK_NODES):
        return _in_order(node, go=FAILURE, stop=SUCCESS)
    if isinstance(node, Leaf) and not isinstance(node, TestNode):
        return _DONE if node.SYNCHRONOUS else _DONE | {RUNNING}  # leaves that skip by themselves are rare
    return _ALL


def _decorated(node: Node, child: frozenset[int]) -> frozenset[int]:
    swap = {SUCCESS: FAILURE, FAILURE: SUCCESS}
    if isinstance(node, decorators.Inverter):
        return frozenset(swap.get(status, status) for status in child)
    if isinstance(node, decorators.ForceSuccess):
        return frozenset(SUCCESS if status == FAILURE else status for status in child)
    if isinstance(node, decorators.ForceFailure):
        return frozenset(FAILURE if status == SUCCESS else status for status in child)
    if isinstance(node, decorators.KeepRunningUntilFailure):
        return frozenset((RUNNING, FAILURE)) if FAILURE in child else frozenset((RUNNING,))
    if isinstance(node, decorators.SubTree):
        return child
    if isinstance(node, decorators.Repeat) and str(node.attributes.get("num_cycles")) == "-1":
        return child - {SUCCESS} | {RUNNING}
    if isinstance(node, decorators.RetryUntilSuccessful) and str(node.attributes.get("num_attempts")) == "-1":
        return child - {FAILURE} | {RUNNING}
    return _ALL


def _in_order(node: Node, *, go: int, stop: int) -> frozenset[int]:
    results: set[int] = set()
    passes_go = False
    for child in node.nodes_below():
        child_results = possible_results(child)
        results |= child_results & {stop, RUNNING}
        passes_go = passes_go or go in child_results
        if not child_results & {go, SKIPPED}:
            return frozenset(results)
    if passes_go:
        results.add(go)
    if all(SKIPPED in possible_results(child) for child in node.nodes_below()):
        results.add(SKIPPED)
    return frozenset(results)


def unreachable_children(tree: Tree) -> Iterator[tuple[Node, Node]]:
    """Yield each child that can never be ticked, and the sibling that prevents it."""
    for node in tree.nodes:
        go = SUCCESS if isinstance(node, _SEQUENCE_NODES) else FAILURE if isinstance(node, _FALLBACK_NODES) else None
        if go is None:
            continue
        blocking: Node | None = None
        for child in node.nodes_below():
            if blocking is not None:
                yield child, blocking
            elif not possible_results(child) & {go, SKIPPED}:
                blocking = child
