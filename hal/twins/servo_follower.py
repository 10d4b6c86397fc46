"""What a robot's controller does with streamed set-points: it moves from one to the next, and refuses jumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LONGEST_INTERVAL = 0.1
SMOOTHING = 0.1
"""Weight of the newest interval in the mean that set-points are spread over."""


class ServoFollower:
    """Spreads each set-point (n,) over the usual time between two, so that they may come with some jitter.

    ``too_fast``: set once a set-point is further away than the joints can move within one and a half times that.
    """

    def __init__(self, start: Array, speed: Array) -> None:
        self._speed = speed
        self.setpoint: Array = start.copy()
        self._goal: Array = start.copy()
        self._left = 0.0
        self._since = np.inf
        self._interval = 0.01
        self._fastest = 0.0
        self.too_fast = False

    @property
    def silent_for(self) -> float:
        """Seconds since the last set-point came."""
        return self._since

    @property
    def moving(self) -> bool:
        """Whether the last set-point is not reached yet."""
        return self._left > 0.0 or bool(np.any(self._goal != self.setpoint))

    def take(self, goal: Array) -> None:
        """A set-point has come."""
        if self._since < LONGEST_INTERVAL:
            self._interval += SMOOTHING * (self._since - self._interval)
        self._since = 0.0
        self._goal, self._left = goal, max(self._interval, 1e-3)
        reach = 1.5 * self._speed * max(self._left, 0.01) + 0.02
        self.too_fast = self.too_fast or bool(np.any(np.abs(goal - self.setpoint) > reach))

    def advance(self, dt: float) -> Array:
        """The joints' set-point ``dt`` seconds later, never faster than their limits."""
        self._since += dt
        share = min(1.0, dt / self._left) if self._left > 0.0 else 1.0
        step = np.clip((self._goal - self.setpoint) * share, -self._speed * dt, self._speed * dt)
        self._left -= dt
        self._fastest = float(np.max(np.abs(step))) / dt
        self.setpoint = self.setpoint + step
        return self.setpoint

    def faster_than(self, speed: float) -> bool:
        """Whether a joint's set-point moved faster than ``speed`` rad/s, with a tenth to spare, in the last step."""
        return self._fastest > 1.1 * speed
