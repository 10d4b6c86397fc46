"""Emulates a controller's processing of streamed set-points: smooth tracking, and refusal of jumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STIFFNESS = 100.0
"""Natural frequency of the critically damped filter between set-points and drives, rad/s; its lag is 2 / 100 s = 20 ms.
"""
NOMINAL_INTERVAL = 0.01
JUMP_FACTOR, JUMP_MARGIN = 1.5, 0.02


class ServoFollower:
    """A critically damped second-order filter on set-points (n,), which tolerates jitter.

    ``too_fast``: set once a set-point is farther from the previous one than the joints can move in the time between, by
    the filter's time and by arrival: a world behind real time processes several at once.
    """

    def __init__(self, start: Array, speed: Array) -> None:
        self._speed = speed
        self.setpoint: Array = start.copy()
        self._velocity: Array = np.zeros_like(start)
        self._goal: Array = start.copy()
        self._since = np.inf
        self._arrived = -np.inf
        self.too_fast = False

    @property
    def moving(self) -> bool:
        """Return whether the last set-point is not reached yet."""
        return bool(np.any(np.abs(self._goal - self.setpoint) > 1e-5))

    def rest(self) -> None:
        """Reset: the joints are at rest at their set-point."""
        self._goal, self._velocity = self.setpoint.copy(), np.zeros_like(self.setpoint)

    def take(self, arrived: float, *goals: Array) -> None:
        """Process set-points that were found at ``arrived`` seconds of the machine's clock.

        Several arrive at once if the process was delayed: their arrival times are unknown, so each may have arrived at
        the end of the interval.
        """
        between = max(self._since, arrived - self._arrived)
        reach = JUMP_FACTOR * self._speed * max(min(between, 0.1), NOMINAL_INTERVAL) + JUMP_MARGIN
        for goal in goals:
            self.too_fast = self.too_fast or bool(np.any(np.abs(goal - self._goal) > reach))
            self._goal = goal
        self._since, self._arrived = 0.0, arrived

    def advance(self, dt: float) -> Array:
        """Return the joints' set-point ``dt`` seconds later, never faster than their limits; exact for a goal that
        rests.
        """
        self._since += dt
        decay = np.exp(-STIFFNESS * dt)
        error = self.setpoint - self._goal
        change = (self._velocity + STIFFNESS * error) * dt
        wanted = self._goal + (error + change) * decay
        step = np.clip(wanted - self.setpoint, -self._speed * dt, self._speed * dt)
        self._velocity = np.clip((self._velocity - STIFFNESS * change) * decay, -self._speed, self._speed)
        self.setpoint = self.setpoint + step
        return self.setpoint

    def faster_than(self, speed: float) -> bool:
        """Return whether a joint moves faster than ``speed`` rad/s, with a tolerance of 10 %."""
        return bool(np.any(np.abs(self._velocity) > 1.1 * speed))
