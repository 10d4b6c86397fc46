"""Long computations (planning, registration) that a tick must not wait for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

Result = TypeVar("Result")


class Job(ABC, Generic[Result]):
    """A computation that was submitted."""

    @property
    @abstractmethod
    def done(self) -> bool:
        """Whether the result may be taken."""

    @abstractmethod
    def result(self) -> Result:
        """The result, or the exception that the computation raised; only when ``done``."""

    @abstractmethod
    def cancel(self) -> None:
        """Drop the result; idempotent."""


class Computation(ABC):
    """Runs computations for skills."""

    @abstractmethod
    def submit(self, work: Callable[[], Result], cost: float) -> Job[Result]:
        """Start ``work``; ``cost``: seconds that it takes on the robot's computer, for simulated time."""


class TimeSource(Protocol):
    """Anything that tells the time."""

    def now(self) -> float: ...  # noqa: D102


class InlineComputation(Computation):
    """For simulation: computes at once, delivers at submit time + cost.

    So the same seed gives the same run, whatever the load of the machine.
    """

    def __init__(self, clock: TimeSource) -> None:
        self._clock = clock

    def submit(self, work: Callable[[], Result], cost: float) -> Job[Result]:
        """Run ``work`` now; an exception is kept for ``result()``."""
        return _InlineJob(self._clock, work, cost)


class _InlineJob(Job[Result]):
    def __init__(self, clock: TimeSource, work: Callable[[], Result], cost: float) -> None:
        self._clock = clock
        self._due = clock.now() + cost
        self._result: Result
        self._error: Exception | None = None
        try:
            self._result = work()
        except Exception as error:  # noqa: BLE001 - raised again by result(), where the skill handles it
            self._error = error

    @property
    def done(self) -> bool:
        return self._clock.now() >= self._due - 1e-9

    def result(self) -> Result:
        if self._error is not None:
            raise self._error
        return self._result

    def cancel(self) -> None:
        """Nothing runs any more."""
