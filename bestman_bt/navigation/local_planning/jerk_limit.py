"""Velocity commands within limits of acceleration and jerk."""

from __future__ import annotations

import math

from bestman_bt.messages import Twist2D
from bestman_bt.robot_model import MobilePart


class JerkLimit:
    """Brings one command after the other towards what is wanted; remembers velocity and acceleration of each axis.

    The acceleration falls to zero in time before the wanted velocity is reached, so that it is not overshot.
    """

    def __init__(self, limits: MobilePart) -> None:
        self._bounds = (
            (limits.max_acceleration, limits.max_jerk),
            (limits.max_acceleration, limits.max_jerk),
            (limits.max_angular_acceleration, limits.max_angular_jerk),
        )
        self._velocity = [0.0, 0.0, 0.0]
        self._acceleration = [0.0, 0.0, 0.0]

    @property
    def twist(self) -> Twist2D:
        """The last command."""
        return Twist2D(*self._velocity)

    def reset(self, twist: Twist2D) -> None:
        """Go on from ``twist``, at no acceleration."""
        self._velocity = [twist.vx, twist.vy, twist.wz]
        self._acceleration = [0.0, 0.0, 0.0]

    def brake(self, wanted: Twist2D, dt: float) -> Twist2D:
        """The command for the next ``dt`` seconds where safety asks for less: jerk does not count then."""
        for axis, (goal, (most, _)) in enumerate(zip((wanted.vx, wanted.vy, wanted.wz), self._bounds, strict=True)):
            change = min(max(goal - self._velocity[axis], -most * dt), most * dt)
            self._velocity[axis] += change
            self._acceleration[axis] = change / dt
        return self.twist

    def towards(self, wanted: Twist2D, dt: float) -> Twist2D:
        """The command for the next ``dt`` seconds."""
        for axis, (goal, (most, jerk)) in enumerate(zip((wanted.vx, wanted.vy, wanted.wz), self._bounds, strict=True)):
            before = self._acceleration[axis]
            left = goal - self._velocity[axis]
            # From an acceleration a, the velocity still changes by a² / (2 jerk) until a is zero; one step is gone
            # before that begins.
            after = max(0.0, abs(left) - abs(before) * dt)
            ideal = math.copysign(min(most, math.sqrt(2.0 * jerk * after), abs(left) / dt), left)
            acceleration = before + min(max(ideal - before, -jerk * dt), jerk * dt)
            acceleration = min(max(acceleration, -most), most)
            change = acceleration * dt
            lands = abs(left) <= abs(change) if change * left > 0.0 else abs(left) < 1e-3
            self._velocity[axis] = goal if lands else self._velocity[axis] + change
            self._acceleration[axis] = 0.0 if lands else acceleration
        return self.twist
