"""Decorators that decide how often the child is executed: once, a number of times, or until it fails."""

from __future__ import annotations

from typing import ClassVar

from py_trees.ports import PortInformation

from bestman_bt.engine.core.ports import In, key_of
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class RunOnce(Decorator):
    """Ticks its child once until it has finished; then SKIPPED, or the same result with ``then_skip="false"``."""

    then_skip = In(
        bool,
        "If true, skip after the first execution, otherwise return the same NodeStatus returned once by the child.",
        default=True,
    )
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Initialise without a result."""
        self.result: int | None = None

    def on_tick(self) -> int:
        """Tick the child unless it has finished."""
        if self.result is not None:
            return SKIPPED if self.then_skip else self.result
        self.set_state(RUNNING)
        status = self.child.execute_tick()
        if status in (SUCCESS, FAILURE):
            self.result = status
            self.reset_child()
        return status


class _Counting(Decorator):
    AGAIN: ClassVar[int]
    """The result of the child that is counted; the other result ends the node."""
    limit: ClassVar[In[int]]
    RESETS_CHILD = True
    CHECKED_AT_TICK = True
    count: int = 0

    def on_load(self) -> None:
        """Check a literal count. Raises ValueError below -1."""
        port = type(self).limit.port
        value = self.attributes.get(port)
        if value is not None and key_of(value, port) is None and self.limit < -1:
            raise ValueError(f"{port} is {value}; 0 or more is accepted, or -1: for ever")

    def halt(self) -> None:
        """Forget the count."""
        self.count = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick the child until it runs, ends the node, or the count is reached.

        Between two rounds that each took one tick the node returns RUNNING and wakes the loop. A failure after several
        ticks is reported to the listeners before the next round begins, which overwrites the feedback of the leaves.
        """
        child = self.child
        limit = self.limit
        again = self.count < limit or limit == -1
        self.set_state(RUNNING)
        while again:
            was_idle = child._s <= IDLE
            status = child.execute_tick()
            if status == RUNNING:
                return RUNNING
            if status == SKIPPED:
                self.reset_child()
                return SKIPPED
            if status != self.AGAIN:
                self.count = 0
                self.reset_child()
                return status
            self.count += 1
            if self.AGAIN == FAILURE:
                limit = self.limit
            again = self.count < limit or limit == -1
            self.reset_child()
            if was_idle and again:
                self.wake_up()
                return RUNNING
            if status == FAILURE:
                self.owner.publish()
        self.count = 0
        return self.AGAIN


class Repeat(_Counting):
    """Ticks a succeeding child up to ``num_cycles`` times (-1: forever); fails when the child fails."""

    AGAIN = SUCCESS
    limit = In[int](
        PortInformation(int, True, "Repeat a successful child up to N times. Use -1 to create an infinite loop."),
        port="num_cycles",
    )


class RetryUntilSuccessful(_Counting):
    """Ticks a failing child up to ``num_attempts`` times (-1: forever); succeeds when the child succeeds."""

    AGAIN = FAILURE
    limit = In[int](
        PortInformation(int, True, "Execute again a failing child up to N times. Use -1 to create an infinite loop."),
        port="num_attempts",
    )


class KeepRunningUntilFailure(Decorator):
    """Returns RUNNING until the child fails."""

    RESETS_CHILD = True

    def on_tick(self) -> int:
        """Tick the child once."""
        self.set_state(RUNNING)
        status = self.child.execute_tick()
        if status == FAILURE:
            self.reset_child()
            return FAILURE
        if status == SUCCESS:
            self.reset_child()
        return RUNNING
