"""Long computations (planning, registration) that a tick must not wait for."""

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
        """Start ``work``; ``cost``: seconds that it takes on the robot's computer, for simulated time.

        The ``result`` of one that has failed raises what ``work`` raised.
        """


class TimeSource(Protocol):
    """Anything that tells the time."""

    def now(self) -> float: ...  # noqa: D102


class InlineComputation(Computation):
    """For simulation: computes at once, delivers at submit time + cost.

    So the same seed gives the same run, whatever the load of the machine.
    """

    def __init__(self, clock: TimeSource) -> None:
        self._clock = clock

    def submit(self, work: Callable[[], Result], cost: float) -> Motion[Result]:
        """Run ``work`` now; an exception is kept for ``result``."""
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


# Waiting for a condition, also while something moves.


class Until(Motion[None]):
    """Ends at the first look at which ``condition`` holds; with ``motion``, also when that has ended, however.

    The motion goes on where the condition holds first; to cancel the waiting is to cancel it.
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
    """A condition that holds from ``duration`` seconds after now on."""
    end = clock.now() + duration
    return lambda: clock.now() >= end
