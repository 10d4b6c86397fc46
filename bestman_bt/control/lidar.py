"""Lidars fixed to the base: scans with the pose at which they were taken."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import LaserScan, Pose2D
from hal.api import Lidar


def deskewed(scan: LaserScan, moved: Pose2D) -> LaserScan:
    """Return the scan of a lidar at rest at the stamp.

    ``moved``: the lidar's motion (m, rad) during the sweep, assumed uniform. If two hits fall onto one beam, the nearer
    one is kept.
    """
    count, hit = len(scan.ranges), np.isfinite(scan.ranges)
    share, ranges, angles = np.arange(count)[hit] / count, scan.ranges[hit], scan.angles[hit]
    angles = angles + share * moved.theta
    x = share * moved.x + ranges * np.cos(angles)
    y = share * moved.y + ranges * np.sin(angles)
    turn = (np.arctan2(y, x) - scan.angle_min + scan.angle_increment / 2) % (2.0 * np.pi)
    beams = np.floor(turn / scan.angle_increment).astype(int)
    seen = beams < count
    straight = np.full(count, np.inf)
    np.minimum.at(straight, beams[seen], np.hypot(x, y)[seen])
    return replace(scan, ranges=straight, time_increment=0.0)


class LidarSensor:
    """A planar lidar and its place on the base."""

    def __init__(self, lidar: Lidar, kinematics: ForwardKinematics) -> None:
        self._lidar = lidar
        self._kinematics = kinematics

    @cached_property
    def base_from_lidar(self) -> Pose2D:
        """The lidar's pose in the base frame, seen from above."""
        return self._kinematics.pose(self._lidar.frame, {}).to_pose2d()

    @cached_property
    def height(self) -> float:
        """Height of the scan plane above the floor, metres."""
        return float(self._kinematics.pose(self._lidar.frame, {}).position[2])

    def scan(self) -> LaserScan:
        """Return the latest scan, in the lidar frame."""
        return self._lidar.scan()

    def points(self) -> NDArray[np.float64]:
        """Return the hits of the latest scan in the base frame, (N, 2) metres."""
        return self.base_from_lidar.apply(self.scan().points())
