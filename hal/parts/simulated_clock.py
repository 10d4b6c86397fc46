"""Simulated time: sleeping steps physics and runs the due periodic calls, in one thread."""

from __future__ import annotations

import math
from collections.abc import Callable

from hal.api import Clock, NotConnectedError, Timer

# A timer or a sleep that ends within this share of a physics step counts as ended.
ROUNDING = 1e-6


class SimulatedClock(Clock):
    """Counts physics steps of ``time_step`` seconds; remainders of a sleep carry over to the next.

    ``step`` advances the physics by one step; the robot sets it while it is connected.
    """

    def __init__(self, time_step: float) -> None:
        self.time_step = time_step
        self._steps = 0
        self._target = 0.0
        self._timers: list[Timer] = []
        self._sleeping = False
        self.step: Callable[[], None] | None = None

    def now(self) -> float:
        """Return the simulated seconds since the robot was first connected."""
        return self._steps * self.time_step

    def sleep(self, duration: float) -> None:
        """Step physics for ``duration`` seconds, rounded down to steps; the remainder carries over.

        Raises:
            ValueError: the duration is negative or infinite.
            NotConnectedError: the robot is not connected.
            RuntimeError: the call comes from within a periodic call.
        """
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"sleep duration should be finite and not negative but is {duration!r}")
        if self.step is None:
            raise NotConnectedError("the clock cannot sleep while the robot is not connected")
        if self._sleeping:
            raise RuntimeError("sleep was called from a periodic call, which must return immediately")
        self._target += duration
        self._sleeping = True
        try:
            while (self._steps + 1 - ROUNDING) * self.time_step <= self._target:
                self._advance()
        finally:
            self._sleeping = False

    def every(self, period: float, call: Callable[[], None]) -> Timer:
        """Call ``call`` every ``period`` seconds; calls due at the same step run in the order of registration.

        Raises ValueError if ``period`` is not finite and positive.
        """
        timer = Timer(period, self.now(), call)
        self._timers.append(timer)
        return timer

    def cancel_timers(self) -> None:
        """Cancel all periodic calls (on disconnect)."""
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()

    def _advance(self) -> None:
        step = self.step
        if step is None:  # disconnected by a periodic call
            raise NotConnectedError("the robot was disconnected while the clock slept")
        step()
        self._steps += 1
        if not self._timers:
            return
        reached = (self._steps + ROUNDING) * self.time_step
        for timer in tuple(self._timers):
            while not timer.cancelled and timer.due <= reached:
                timer.run()
        if any(timer.cancelled for timer in self._timers):
            self._timers = [timer for timer in self._timers if not timer.cancelled]
