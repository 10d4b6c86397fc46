"""Native py_trees behaviours as nodes: each has its own node, below an engine node or a native parent.

A native parent ticks and stops its children itself. ``take_over`` replaces ``tick`` and ``stop`` of each behaviour, so
that they act as ticks and halts of its node, with states, hooks, visits and errors.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, Final
from weakref import WeakKeyDictionary

from py_trees import composites, decorators, timers
from py_trees.behaviour import Behaviour
from py_trees.behaviours import (
    CheckBlackboardVariableExists,
    CheckBlackboardVariableValue,
    CheckBlackboardVariableValues,
    CompareBlackboardVariables,
)
from py_trees.common import Status as PyTreesStatus

from bestman_bt.engine.core.node import Node, creation_line
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS, TO_PY_TREES, from_py_trees

if TYPE_CHECKING:
    from bestman_bt.engine.clock import EngineClock


class PyTreesBehaviour(Node, Behaviour):
    """A native py_trees behaviour as a node; a tick that ends with INVALID is an error."""

    def __init__(self, behaviour: Behaviour | None = None) -> None:
        if behaviour is None:
            raise TypeError("PyTreesBehaviour takes the behaviour that it adapts")
        super().__init__(name=" ".join(behaviour.name.split()))
        self.behaviour = behaviour
        self.is_set_up = False
        self.made_in, self.line = _lines.get(behaviour) or _class_at(behaviour)

    if not TYPE_CHECKING:
        id = property(attrgetter("behaviour.id"))
        blackboards = property(attrgetter("behaviour.blackboards"))
        blackbox_level = property(attrgetter("behaviour.blackbox_level"))
        feedback_message = property(attrgetter("behaviour.feedback_message"))

    @property
    def type_id(self) -> str:
        """The name of the behaviour's class."""
        return type(self.behaviour).__name__

    def setup(self, **kwargs: Any) -> None:
        """Call the behaviour's ``setup`` once, with ``context`` and ``clock`` if its signature accepts them.

        Raises:
            NodeError: it failed.
        """
        if self.is_set_up:
            return
        offered = {"context": self.context, "clock": self.clock}
        taken = inspect.signature(self.behaviour.setup).parameters
        if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in taken.values()):
            offered = {name: value for name, value in offered.items() if name in taken}
        try:
            self.behaviour.setup(**(offered | kwargs))
        except (Exception, SystemExit) as error:  # a user's behaviour may raise anything
            raise self.error(f"its setup() failed: {error or type(error).__name__}") from error
        self.is_set_up = True

    def shutdown(self) -> None:
        """Call the behaviour's ``shutdown`` if it was set up.

        Raises:
            NodeError: it failed.
        """
        if self.is_set_up:
            self.is_set_up = False
            try:
                self.behaviour.shutdown()
            except (Exception, SystemExit) as error:  # a user's behaviour may raise anything
                raise self.error(f"its shutdown() failed: {error or type(error).__name__}") from error

    def on_tick(self) -> int:
        """Tick the behaviour once and return its status."""
        behaviour, tree = self.behaviour, self.owner
        outer = _clock.set(tree.clock)
        try:
            for _ in type(behaviour).tick(behaviour):
                pass
        finally:
            _clock.reset(outer)
            tree.share_entries()
        status = from_py_trees(behaviour.status)
        if status != RUNNING:
            for child in self.nodes_below():
                if child._s > RUNNING:
                    child.reset_status()
        return status

    def halt(self) -> None:
        """Stop the behaviour if it is running."""
        if self.behaviour.status is PyTreesStatus.RUNNING:
            self.stop_behaviour(PyTreesStatus.INVALID)
        self.reset_status()

    def stop_behaviour(self, new_status: PyTreesStatus) -> None:
        """Stop the behaviour as its native parent does; an interruption makes the node idle."""
        type(self.behaviour).stop(self.behaviour, new_status)
        if new_status is PyTreesStatus.INVALID:
            self.reset_status()
            self.owner.share_entries()


class NativeCondition(PyTreesBehaviour):
    """A native behaviour that checks the blackboard and fails if the check is false."""

    KIND: ClassVar[str] = "Condition"


class NativeComposite(PyTreesBehaviour, composites.Composite):
    """A native composite; one class per kind, because py_trees' display depends on the kind."""

    KIND: ClassVar[str] = "Control"
    if not TYPE_CHECKING:
        memory = property(attrgetter("behaviour.memory"))
        policy = property(attrgetter("behaviour.policy"))


class NativeSequence(NativeComposite, composites.Sequence):
    """A native Sequence."""


class NativeSelector(NativeComposite, composites.Selector):
    """A native Selector."""


class NativeParallel(NativeComposite, composites.Parallel):
    """A native Parallel."""


class NativeDecorator(PyTreesBehaviour, decorators.Decorator):
    """A native decorator."""

    KIND: ClassVar[str] = "Decorator"


_ADAPTERS: Final[dict[Any, type[PyTreesBehaviour]]] = {
    composites.Sequence: NativeSequence,
    composites.Selector: NativeSelector,
    composites.Parallel: NativeParallel,
    composites.Composite: NativeComposite,
    decorators.Decorator: NativeDecorator,
    CheckBlackboardVariableExists: NativeCondition,
    CheckBlackboardVariableValue: NativeCondition,
    CheckBlackboardVariableValues: NativeCondition,
    CompareBlackboardVariables: NativeCondition,
}


_lines: WeakKeyDictionary[Behaviour, tuple[str, int]] = WeakKeyDictionary()
"""Native behaviour → file and line of the creating call, if it was recorded."""


@contextmanager
def creation_lines_recorded() -> Iterator[None]:
    """Record the creating line of native behaviours made inside this context, for messages."""
    original = Behaviour.__init__

    def __init__(self: Behaviour, *args: Any, **kwargs: Any) -> None:  # noqa: N807 - frames of constructors are passed over
        _lines[self] = creation_line(self)
        original(self, *args, **kwargs)

    Behaviour.__init__ = __init__  # type: ignore[method-assign] # py_trees has no hook for it
    try:
        yield
    finally:
        Behaviour.__init__ = original  # type: ignore[method-assign] # as above


def _class_at(behaviour: Behaviour) -> tuple[str, int]:
    """Return file and line of ``update`` in a user's class; ("", 0) for a class of py_trees."""
    code = getattr(type(behaviour).update, "__code__", None)
    if code is None or (type(behaviour).update.__module__ or "").startswith("py_trees."):
        return "", 0
    return code.co_filename, code.co_firstlineno


def adapted(behaviour: Behaviour) -> PyTreesBehaviour:
    """Return the node of a native behaviour."""
    kind = next((kind for native, kind in _ADAPTERS.items() if isinstance(behaviour, native)), PyTreesBehaviour)
    return kind(behaviour)


def belongs_to_tree(behaviour: Behaviour) -> bool:
    """Return whether a native behaviour belongs to a tree already."""
    return "tick" in vars(behaviour)


def take_over(behaviour: Behaviour, node: Node) -> None:
    """Make ticks and stops of ``behaviour`` by a native parent act on ``node``.

    ``node`` is the behaviour's own node, its replacement, or the behaviour itself if it is an engine node.
    """
    own: Any = behaviour
    own.tick = partial(_ticked_by_native_parent, behaviour, node)
    if isinstance(node, PyTreesBehaviour):
        own.stop = node.stop_behaviour
    _follow_clocks()


def _ticked_by_native_parent(behaviour: Behaviour, node: Node) -> Iterator[Behaviour]:
    tree = node.owner
    if not isinstance(node, PyTreesBehaviour):
        tree.share_entries()  # with what the parent wrote for it
    status = node.execute_tick()
    if status == SKIPPED:
        status = FAILURE if isinstance(node.parent, composites.Selector) else SUCCESS
        node._s = -status
    elif status != RUNNING and not isinstance(node, PyTreesBehaviour):
        node.reset_status()
    shown = TO_PY_TREES[status]
    if behaviour.status is not shown:  # a hook, or a node in its place, has decided
        type(behaviour).stop(behaviour, shown)
        behaviour.status = shown
    yield behaviour


_clock: ContextVar[EngineClock | None] = ContextVar(
    "the clock of the tree whose native behaviour is ticked", default=None
)


class _TreeTime:
    """A replacement for the module ``time`` in py_trees' Timer and Timeout: the tree's clock while a tree ticks
    them.
    """

    def time(self) -> float:
        clock = _clock.get()
        return time.time() if clock is None else clock.now()

    def monotonic(self) -> float:
        clock = _clock.get()
        return time.monotonic() if clock is None else clock.now()

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


def _follow_clocks() -> None:
    modules: list[Any] = [timers, decorators]
    for module in modules:
        if module.time is time:
            module.time = _TreeTime()
