"""Kinematics and odometry of a differential drive; pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bestman_bt.messages import Pose2D, wrap_angle


@dataclass(frozen=True)
class DifferentialDrive:
    """Two wheels on one axle; metres. ``left_radius`` and ``right_radius`` may differ (calibration errors)."""

    left_radius: float
    right_radius: float
    track: float

    def wheel_speeds(self, vx: float, wz: float) -> tuple[float, float]:
        """Left and right wheel speed, rad/s, for a velocity in m/s and rad/s."""
        half = wz * self.track / 2.0
        return (vx - half) / self.left_radius, (vx + half) / self.right_radius

    def twist(self, left: float, right: float) -> tuple[float, float]:
        """(vx, wz) or, for wheel angles, (distance, angle)."""
        left_path, right_path = left * self.left_radius, right * self.right_radius
        return (left_path + right_path) / 2.0, (right_path - left_path) / self.track


class Odometry:
    """Dead reckoning from wheel angles (rad), midpoint rule: the pose since the first reading, and the path."""

    def __init__(self, drive: DifferentialDrive, left: float, right: float) -> None:
        self._drive = drive
        self._left, self._right = left, right
        self.x = self.y = self.heading = self.travelled = 0.0

    @property
    def pose(self) -> Pose2D:
        """The pose in the odom frame."""
        return Pose2D(self.x, self.y, wrap_angle(self.heading))

    def update(self, left: float, right: float) -> None:
        """Take in a reading of the wheel angles."""
        distance, angle = self._drive.twist(left - self._left, right - self._right)
        self._left, self._right = left, right
        middle = self.heading + angle / 2.0
        self.x += distance * math.cos(middle)
        self.y += distance * math.sin(middle)
        self.heading += angle
        self.travelled += distance
