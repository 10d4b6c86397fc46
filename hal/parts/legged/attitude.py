"""Attitude from an inertial unit: a complementary filter.

R. Mahony, T. Hamel and J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal group", 2008: the
gyroscope turns the estimate, the direction of gravity pulls it upright; what is left over at rest is the gyroscope's
bias.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

GRAVITY = 9.81
Array = NDArray[np.float64]


@dataclass(eq=False)
class Attitude:
    """The trunk's orientation; its heading begins at 0 and drifts as the gyroscope does.

    ``gain``: 1/s with which gravity pulls the estimate upright. ``bias_time``: seconds over which the bias is
    learned while the robot stands still: turns by less than ``still`` rad/s.
    """

    gain: float = 0.3
    bias_time: float = 2.0
    still: float = 0.03

    def __post_init__(self) -> None:
        self._rotation = Rotation.identity()
        self._bias = np.zeros(3)
        self.rate: Array = np.zeros(3)

    @property
    def odom_from_trunk(self) -> Array:
        """Rotation matrix (3, 3)."""
        return np.asarray(self._rotation.as_matrix())

    @property
    def heading(self) -> float:
        """Yaw, radians in (-π, π]."""
        forward = self.odom_from_trunk[:, 0]
        return math.atan2(forward[1], forward[0])

    @property
    def level_from_trunk(self) -> Array:
        """Rotation matrix (3, 3) to the frame that is level and points where the trunk does."""
        return np.asarray((Rotation.from_euler("z", -self.heading) * self._rotation).as_matrix())

    def update(self, angular_velocity: Array, specific_force: Array, period: float, standing: bool) -> None:
        """Take in a reading of the trunk's (3,) rad/s and (3,) m/s²."""
        self.rate = angular_velocity - self._bias
        if standing and float(np.abs(self.rate).max()) < self.still:
            self._bias = self._bias + min(1.0, period / self.bias_time) * (angular_velocity - self._bias)
        # Steps shake the trunk by several g, but in the mean they hold it up: whole readings, never chosen ones.
        up = self.odom_from_trunk[2]
        turn = self.rate + self.gain * np.cross(specific_force / GRAVITY, up)
        self._rotation = self._rotation * Rotation.from_rotvec(turn * period)
