"""Lidars that are fixed to the base: scans together with where they were taken from."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.messages import LaserScan, Pose2D
from hal.api import Lidar


class LidarSensor:
    """A planar lidar and its place on the base."""

    def __init__(self, lidar: Lidar, kinematics: ForwardKinematics) -> None:
        self._lidar = lidar
        self._kinematics = kinematics

    @cached_property
    def base_from_lidar(self) -> Pose2D:
        """The lidar's pose in the base frame, seen from above."""
        return self._kinematics.pose(self._lidar.frame, {}).to_pose2d()

    def scan(self) -> LaserScan:
        """The latest scan, in the lidar frame."""
        return self._lidar.scan()

    def points(self) -> NDArray[np.float64]:
        """The hits of the latest scan in the base frame, (N, 2) metres."""
        return self.base_from_lidar.apply(self.scan().points())
