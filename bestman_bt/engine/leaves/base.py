"""The leaves that skills derive from: a synchronous action, a condition, and a stateful action."""

from __future__ import annotations

from typing import Annotated, ClassVar

from annotated_types import Ge
from py_trees.behaviour import Behaviour

from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.status import FAILURE, IDLE, RUNNING, SUCCESS


class Leaf(Node, Behaviour):
    """A node without children."""

    def halt(self) -> None:
        """Become idle."""
        self.reset_status()


class SyncAction(Leaf):
    """An action that is done within one tick: implement ``on_tick() -> int`` (SUCCESS, FAILURE or SKIPPED)."""

    SYNCHRONOUS = True


class Condition(Leaf):
    """A question: implement ``on_tick() -> int`` (SUCCESS for yes, FAILURE for no), without side effects.

    As in BehaviorTree.CPP it may also return RUNNING; the parent then asks it again.
    """

    KIND: ClassVar[str] = "Condition"


class StatefulAction(Leaf):
    """An action that takes several ticks.

    Implement ``on_start()`` (the first tick), ``on_running()`` (the ticks after it while RUNNING) and
    ``on_halted()`` (somebody interrupts it: leave nothing moving). Where stopping takes several ticks, define
    ``on_stopping()``, too: who has halted it waits, ``STOP_TIMEOUT`` seconds at most.
    """

    def on_start(self) -> int:
        """Begin, and return RUNNING, or a result that is known at once."""
        raise NotImplementedError(f"{type(self).__name__} does not define on_start()")

    def on_running(self) -> int:
        """Look whether it is done; RUNNING if not."""
        raise NotImplementedError(f"{type(self).__name__} does not define on_running()")

    def on_halted(self) -> None:
        """Stop what was begun. It is not called when the action ended by itself."""

    def on_tick(self) -> int:
        """Call ``on_start`` or ``on_running``; a result that nobody reset yet is returned again."""
        code = self._s
        if code <= IDLE:
            return self.on_start()
        if code == RUNNING:
            return self.on_running()
        return code

    def halt(self) -> None:
        """Call ``on_halted`` if the action runs, and become idle."""
        if self._s == RUNNING:
            self.on_halted()
            if self.STOPS_OVER_TICKS and self.on_stopping() == RUNNING:
                self.owner.stopping.add(self, self.clock.now() + self.STOP_TIMEOUT)
        self.reset_status()


# Sleep: RUNNING for a while.


class Sleep(StatefulAction):
    """RUNNING for ``msec`` milliseconds of the tree's clock, then SUCCESS."""

    CHECKED_AT_TICK = True
    INPUT_PORTS = {"msec": BoundedPort(Annotated[int, Ge(0)], True, "how long, in milliseconds")}

    def on_start(self) -> int:
        """Remember the time."""
        self.end = self.clock.now() + self.get_input("msec") * 1e-3
        return RUNNING if self.get_input("msec") > 0 else SUCCESS

    def on_running(self) -> int:
        """Look at the clock."""
        return SUCCESS if self.clock.now() >= self.end else RUNNING

    def on_halted(self) -> None:
        """Nothing is left moving by a sleep."""


# AlwaysSuccess and AlwaysFailure.


class AlwaysSuccess(SyncAction):
    """SUCCESS at every tick."""

    def on_tick(self) -> int:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(SyncAction):
    """FAILURE at every tick."""

    def on_tick(self) -> int:
        """Fail."""
        return FAILURE
