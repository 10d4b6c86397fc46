"""Strict order of reactive nodes (``_strict="true"``), and halts that need several ticks.

Below a strict node, the running child is halted before an asynchronous leaf of another child starts. An action whose
``on_stopping`` returns RUNNING is still stopping: the node that halted it withholds its result until it has stopped,
and its successor below a strict node starts only then. Other nodes are ticked as usual.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final, Protocol, runtime_checkable

from bestman_bt.engine.status import IDLE, RUNNING

if TYPE_CHECKING:
    from bestman_bt.engine.core.node import Node
    from bestman_bt.engine.core.tick_hooks import Tick
    from bestman_bt.engine.core.tree import Tree

STRICT: Final = "_strict"
TRUE: Final = frozenset(("true", "1", "True", "TRUE", True))
_LOG = logging.getLogger(__name__)


@runtime_checkable
class Reactive(Protocol):
    """A reactive node with optional strict order; ``runner``: its running child."""

    runner: Node | None

    def replace_runner(self, child: Node | None) -> None:
        """Halt the running child; ``child`` takes its place."""


class Order:
    """The pending waits of one node.

    Attributes:
        gates: of an asynchronous leaf, the strict nodes above it, outermost first, each with its child on the path.
        slow: the leaves whose stopping this node waits for.
        waiting: whether the leaf starts as soon as they have stopped.
        withheld: the result that the node gets as soon as they have stopped.
    """

    __slots__ = ("gates", "slow", "waiting", "withheld")

    def __init__(self) -> None:
        self.gates: list[tuple[Reactive, Node]] = []
        self.slow: set[Node] = set()
        self.waiting = False
        self.withheld: int | None = None


class Stopping:
    """The halted actions of a tree that are still stopping; ``until``: the end of the wait for each one, seconds of the
    clock.
    """

    def __init__(self) -> None:
        self.until: dict[Node, float] = {}

    def add(self, leaf: Node, until: float) -> None:
        """Poll ``leaf`` at each tick until ``until``, seconds of the clock."""
        self.until[leaf] = until

    def any_of(self, leaves: set[Node]) -> bool:
        """Return whether one of ``leaves`` is still stopping."""
        return bool(self.until) and not leaves.isdisjoint(self.until)

    def ask(self, now: float) -> None:
        """Remove the leaves that have stopped, and those that exceeded their stop timeout at ``now``."""
        for leaf, until in list(self.until.items()):
            del self.until[leaf]
            if leaf.on_stopping() == RUNNING:
                if now < until:
                    self.until[leaf] = until
                else:
                    _LOG.warning(
                        "%s: it has not stopped within %g s; waiting nodes continue", leaf.path, leaf.STOP_TIMEOUT
                    )


def set_order(tree: Tree) -> None:
    """Set the orders of a new tree's nodes, if it has strict nodes or actions that stop over several ticks."""
    for node in tree.nodes:
        if node.STOPS_OVER_TICKS:
            for above in upwards(node):
                _order(above).slow.add(node)
    for node in tree.nodes:  # parents come before what is below them, so outer gates before inner ones
        if node.attributes.get(STRICT) in TRUE and isinstance(node, Reactive):
            for child in node.nodes_below():
                for leaf in _starting_leaves(child):
                    order = _order(leaf)
                    order.gates.append((node, child))
                    if node.order is not None:
                        order.slow |= node.order.slow


def in_order(node: Node, core: Tick, order: Order) -> Tick:
    """Return the tick function of a node that waits until halted leaves have stopped."""
    return _leaf_in_order(node, core, order) if not node.children else _parent_in_order(node, core, order)


def _leaf_in_order(node: Node, core: Tick, order: Order) -> Tick:
    stopping = node.owner.stopping

    def run() -> int:
        if node._s > IDLE and not order.waiting:
            return core()
        for strict, child in order.gates:
            if strict.runner is not child:
                strict.replace_runner(None)
        if stopping.any_of(order.slow):
            order.waiting = True
            return RUNNING
        if not order.waiting:
            return core()
        order.waiting = False
        node._s = IDLE  # it has only been said to run
        status = core()
        node._s = RUNNING
        return status

    return run


def _parent_in_order(node: Node, core: Tick, order: Order) -> Tick:
    stopping = node.owner.stopping

    def run() -> int:
        status = order.withheld
        if status is None:
            status = core()
        if status == RUNNING or not stopping.any_of(order.slow):
            order.withheld = None
            return status
        order.withheld = status
        return RUNNING

    return run


def _order(node: Node) -> Order:
    if node.order is None:
        node.order = Order()
    return node.order


def upwards(node: Node) -> Iterator[Node]:
    """Yield the node and its ancestors."""
    above: Node | None = node
    while above is not None:
        yield above
        above = above.parent  # type: ignore[assignment]  # parents of nodes are nodes, or native


def _starting_leaves(node: Node) -> Iterable[Node]:
    if node.children:
        for child in node.nodes_below():
            yield from _starting_leaves(child)
    elif node.KIND == "Action" and not node.SYNCHRONOUS:
        yield node
