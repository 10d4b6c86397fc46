"""Long computations (planning, registration) that run while the tree is ticked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from bestman_bt.control import Motion, MotionStatus
from bestman_bt.errors import Error
from bestman_bt.messages import Failure

Result = TypeVar("Result")


class Computation(ABC):
    """Runs computations for skills."""

    @abstractmethod
    def submit(self, work: Callable[[], Result], cost: float) -> Motion[Result]:
        """Start ``work``. ``cost``: its duration on the robot's computer, simulated seconds.

        If ``work`` raises, reading the ``result`` raises the same error.
        """


class TimeSource(Protocol):
    """A source of time."""

    def now(self) -> float: ...  # noqa: D102


class InlineComputation(Computation):
    """Computation for simulation: computes immediately, delivers at submit time + cost.

    Thus the same seed gives the same run, independent of the machine's load.
    """

    def __init__(self, clock: TimeSource) -> None:
        self._clock = clock

    def submit(self, work: Callable[[], Result], cost: float) -> Motion[Result]:
        """Run ``work`` now; an exception is raised when ``result`` is read."""
        return _Computed(self._clock, work, cost)


class _Computed(Motion[Result]):
    def __init__(self, clock: TimeSource, work: Callable[[], Result], cost: float) -> None:
        super().__init__()
        self._clock = clock
        self._due = clock.now() + cost
        self._found: Result
        self._error: Exception | None = None
        try:
            self._found = work()
        except Exception as error:  # noqa: BLE001 - raised again by result, where the skill handles it
            self._error = error

    @property
    def result(self) -> Result | None:
        if self.status is MotionStatus.FAILED and self._error is not None:
            raise self._error
        return super().result

    def _look(self) -> None:
        if self._clock.now() < self._due - 1e-9:
            return
        if self._error is None:
            self.succeed(self._found)
        else:
            code = self._error.code if isinstance(self._error, Error) else Error.code
            self.end(MotionStatus.FAILED, Failure(code, str(self._error)))


class Until(Motion[None]):
    """Wait until ``condition`` is true; with ``motion``, also end when the motion has ended.

    The condition is checked at each tick. If it is true first, the motion continues; cancelling the wait cancels the
    motion.
    """

    def __init__(self, condition: Callable[[], bool], motion: Motion[Any] | None = None) -> None:
        super().__init__()
        self._condition, self._motion = condition, motion

    def cancel(self) -> None:
        """Cancel the motion, if any."""
        if self._motion is not None:
            self._motion.cancel()

    def _look(self) -> None:
        if (self._motion is not None and self._motion.done) or self._condition():
            self.succeed()


def passed(clock: TimeSource, duration: float) -> Callable[[], bool]:
    """Return a condition that is true from ``duration`` seconds after now."""
    end = clock.now() + duration
    return lambda: clock.now() >= end
