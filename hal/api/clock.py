"""Time, as the robot sees it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable


class Timer(ABC):
    """A periodic call that runs until it is cancelled."""

    @abstractmethod
    def cancel(self) -> None:
        """Stop calling; idempotent."""


class Clock(ABC):
    """The only source of time for everything above the hardware layer.

    In simulation ``sleep`` steps physics and runs the periodic calls that are due, in one thread. On hardware it
    waits, and runs the periodic calls that the thread which sleeps has asked for.
    """

    @abstractmethod
    def now(self) -> float:
        """Seconds since an arbitrary start; never goes back."""

    @abstractmethod
    def sleep(self, duration: float) -> None:
        """Let ``duration`` seconds pass; ValueError if it is negative or not finite."""

    @abstractmethod
    def every(self, period: float, call: Callable[[], None]) -> Timer:
        """Call ``call`` every ``period`` seconds, first after one period; it must return within the period."""
