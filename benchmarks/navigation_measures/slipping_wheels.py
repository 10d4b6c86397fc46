"""Odometry of wheels that slip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bestman_bt.messages import Pose2D
from hal.api import MobileBase, Robot

SLIP_CHANGES = 0.5
"""Seconds after which each wheel slips anew, by up to twice the mean."""


class SlippingWheels:
    """Odometry of two wheels that each turn further than they drive, by a share that changes all the time."""

    def __init__(self, base: MobileBase, now: Callable[[], float], mean_slip: float, seed: int) -> None:
        corners = np.array(base.model.footprint)
        self._track = float(np.ptp(corners[:, 1]))
        self._counted, self._now, self._mean = base.odometry, now, mean_slip
        self._rng = np.random.default_rng([seed, 7])
        self._last, self._pose = self._counted(), Pose2D()
        self._slip, self._until = np.zeros(2), 0.0

    def odometry(self) -> Pose2D:
        """In place of the base's own."""
        if self._now() >= self._until:
            self._slip, self._until = self._rng.uniform(0.0, 2.0 * self._mean, 2), self._now() + SLIP_CHANGES
        pose = self._counted()
        moved, self._last = self._last.inverse() @ pose, pose
        turn = moved.theta * self._track / 2.0
        left, right = np.array([moved.x - turn, moved.x + turn]) / (1.0 - self._slip)
        self._pose = self._pose @ Pose2D(float(left + right) / 2.0, moved.y, float(right - left) / self._track)
        return self._pose


def let_slip(robot: Robot, mean_slip: float, seed: int) -> None:
    """From now on the robot's base counts what its wheels turn, not what they drive."""
    base = robot.part("base", MobileBase)
    base.odometry = SlippingWheels(base, robot.clock.now, mean_slip, seed).odometry
