"""The base classes of leaves: a synchronous action, a condition, and a stateful action; and the simplest leaves."""

from __future__ import annotations

from typing import Annotated, ClassVar

from annotated_types import Ge
from py_trees.behaviour import Behaviour

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import In
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS


class Leaf(Node, Behaviour):
    """A node without children."""

    def halt(self) -> None:
        """Set the leaf to idle."""
        self.reset_status()


class SyncAction(Leaf):
    """An action that finishes within one tick: implement ``on_tick() -> int`` (SUCCESS, FAILURE or SKIPPED)."""

    SYNCHRONOUS = True


class Condition(Leaf):
    """A condition: implement ``on_tick() -> int`` (SUCCESS for true, FAILURE for false), without side effects.

    As in BehaviorTree.CPP it may also return RUNNING; the parent then ticks it again.
    """

    KIND: ClassVar[str] = "Condition"


class StatefulAction(Leaf):
    """An action that takes several ticks.

    Implement ``on_start()`` (the first tick), ``on_running()`` (the ticks after it while RUNNING) and ``on_halted()``
    (the action is halted: stop all motion). If stopping takes several ticks, also define ``on_stopping()``; the node
    that halted it waits for at most ``STOP_TIMEOUT`` seconds.
    """

    def on_start(self) -> int:
        """Start the action; return RUNNING, or a result if it is already known."""
        raise NotImplementedError(f"{type(self).__name__} does not define on_start()")

    def on_running(self) -> int:
        """Return the result, or RUNNING if the action has not finished."""
        raise NotImplementedError(f"{type(self).__name__} does not define on_running()")

    def on_halted(self) -> None:
        """Stop the action. Not called if the action has finished."""

    def on_tick(self) -> int:
        """Call ``on_start`` or ``on_running``; after the end, return the same result until the node is reset."""
        code = self._s
        if code <= IDLE:
            return self.on_start()
        if code == RUNNING:
            return self.on_running()
        return code

    def halt(self) -> None:
        """Call ``on_halted`` if the action is running, and become idle."""
        if self._s == RUNNING:
            self.on_halted()
            if self.STOPS_OVER_TICKS and self.on_stopping() == RUNNING:
                self.owner.stopping.add(self, self.clock.now() + self.STOP_TIMEOUT)
        self.reset_status()


class Sleep(StatefulAction):
    """Returns RUNNING for ``msec`` milliseconds of the tree's clock, then SUCCESS."""

    CHECKED_AT_TICK = True
    msec = In[int](Annotated[int, Ge(0)], "duration, in milliseconds")

    def on_start(self) -> int:
        """Start the timer."""
        self.end = self.clock.now() + self.msec * 1e-3
        return RUNNING if self.msec > 0 else SUCCESS

    def on_running(self) -> int:
        """Return SUCCESS once the time is up."""
        return SUCCESS if self.clock.now() >= self.end else RUNNING

    def on_halted(self) -> None:
        """Do nothing, because the node causes no motion."""


class AlwaysSuccess(SyncAction):
    """Returns SUCCESS at every tick."""

    def on_tick(self) -> int:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(SyncAction):
    """Returns FAILURE at every tick."""

    def on_tick(self) -> int:
        """Fail."""
        return FAILURE
