"""RateController, Timeout and Delay. They read the tree's clock when they are ticked; no timer thread is involved."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt

from bestman_bt.engine.core.ports import In
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS


class RateController(Decorator):
    """Ticks its child when it starts, while it is running, and then once per period of ``hz``; RUNNING in between."""

    hz = In[float](Annotated[float, Gt(0)], "Rate", default=10.0)

    def on_load(self) -> None:
        """Start with the timer stopped."""
        self.started = 0.0
        self.first = True

    def on_tick(self) -> int:
        """Tick the child if it is due."""
        now = self.clock.now()
        if self._s <= IDLE:
            self.started = now
            self.first = True
        self.set_state(RUNNING)
        if self.first or self.child._s == RUNNING or now - self.started >= 1.0 / self.hz:
            self.first = False
            status = self.child.execute_tick()
            if status == SUCCESS:
                self.started = now
            return status
        return RUNNING


class Timed(Decorator):
    """Base of decorators with a timer, which runs from the first tick until the child has ended."""

    RESETS_CHILD = True
    CHECKED_AT_TICK = True

    def on_load(self) -> None:
        """Start with the timer stopped."""
        self.started: float | None = None

    def halt(self) -> None:
        """Stop the timer, then halt."""
        self.started = None
        super().halt()

    def tick_child(self) -> int:
        """Tick the child; once it has ended, reset it and stop the timer."""
        status = self.child.execute_tick()
        if status in (SUCCESS, FAILURE):
            self.started = None
            self.reset_child()
        return status


class Timeout(Timed):
    """Halts its child and fails if the child is still running ``msec`` after the node started (0: never)."""

    msec = In[int](Annotated[int, Ge(0)], "After a certain amount of time, halt() the child if it is still running.")

    def on_tick(self) -> int:
        """Fail if the time limit has passed, else tick the child."""
        duration = self.msec * 1e-3
        if self.started is None:
            self.started = self.clock.now()
            self.set_state(RUNNING)
        child = self.child
        if duration > 0 and child._s == RUNNING and self.clock.now() - self.started >= duration:
            self.reset_child()
            self.started = None
            self.feedback_message = f"timed out after {duration:g} s"
            return FAILURE
        return self.tick_child()


class Delay(Timed):
    """Ticks its child ``delay_msec`` after the node started, in a later tick; RUNNING until then."""

    delay_msec = In[int](Annotated[int, Ge(0)], "Tick the child after a few milliseconds")

    def on_tick(self) -> int:
        """Tick the child once the delay has passed."""
        duration = self.delay_msec * 1e-3
        if self.started is None:
            self.started = self.clock.now()
            self.set_state(RUNNING)
            return RUNNING
        if self.clock.now() - self.started < duration:
            return RUNNING
        return self.tick_child()
