"""Clocks of the engine, read by Timeout, Delay, Sleep and the tick loop."""

from __future__ import annotations

import threading
import time
from typing import Protocol, runtime_checkable


@runtime_checkable
class EngineClock(Protocol):
    """The clock interface that the engine requires."""

    def now(self) -> float:
        """Return the monotonic time in seconds since an arbitrary origin."""
        ...

    def sleep(self, dt: float) -> None:
        """Wait for ``dt`` seconds of this clock; a simulation steps its physics meanwhile."""
        ...


@runtime_checkable
class WakeableClock(EngineClock, Protocol):
    """A clock whose sleep can be cut short, so that a wake-up starts the next tick immediately."""

    def wait(self, dt: float, wake: threading.Event) -> None:
        """Wait for up to ``dt`` seconds; return early when ``wake`` is set."""
        ...


class WallClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """Return the monotonic time in seconds."""
        return time.monotonic()

    def sleep(self, dt: float) -> None:
        """Block for ``dt`` seconds."""
        if dt > 0:
            time.sleep(dt)

    def wait(self, dt: float, wake: threading.Event) -> None:
        """Block for up to ``dt`` seconds, until ``wake`` is set."""
        wake.wait(max(dt, 0.0))


class ManualClock:
    """Simulated time for tests: it passes only in ``sleep``, ``wait`` and ``advance``."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        """Return the simulated time in seconds."""
        return self._now

    def advance(self, dt: float) -> None:
        """Move the time forward by ``dt`` seconds. Raises ValueError if ``dt`` is negative."""
        if dt < 0:
            raise ValueError(f"dt must not be negative but got {dt}")
        self._now += dt

    def sleep(self, dt: float) -> None:
        """Move the time forward by ``dt`` seconds."""
        self.advance(max(dt, 0.0))

    def wait(self, dt: float, wake: threading.Event) -> None:
        """Move the time forward by ``dt`` seconds unless ``wake`` is set already."""
        if not wake.is_set():
            self.sleep(dt)
