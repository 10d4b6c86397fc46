"""Reachability: the possible results of each node, and children that can never be ticked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from bestman_bt.engine import controls, decorators
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.leaves.base import AlwaysFailure, AlwaysSuccess, Leaf
from bestman_bt.engine.leaves.script import Script, TestNode
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS

_ALL: Final = frozenset((RUNNING, SUCCESS, FAILURE, SKIPPED))
_DONE: Final = frozenset((SUCCESS, FAILURE))
_CONDITIONS: Final = (("_failureIf", FAILURE), ("_successIf", SUCCESS), ("_skipIf", SKIPPED), ("_while", SKIPPED))
_SEQUENCES: Final = (controls.Sequence, controls.AsyncSequence, controls.SequenceWithMemory, controls.ReactiveSequence)
_FALLBACKS: Final = (controls.Fallback, controls.AsyncFallback, controls.ReactiveFallback)


def possible_results(node: Node) -> frozenset[int]:
    """Return the statuses that a tick of ``node`` may return, judged by the tree alone."""
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
    if isinstance(node, _SEQUENCES):
        return _in_order(node, go=SUCCESS, stop=FAILURE)
    if isinstance(node, _FALLBACKS):
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
        go = SUCCESS if isinstance(node, _SEQUENCES) else FAILURE if isinstance(node, _FALLBACKS) else None
        if go is None:
            continue
        blocking: Node | None = None
        for child in node.nodes_below():
            if blocking is not None:
                yield child, blocking
            elif not possible_results(child) & {go, SKIPPED}:
                blocking = child
