"""The SLAM interface: localisation on a map that is built during the motion."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, OccupancyGrid, Pose2D
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.navigation.localization.base import LocalizationEstimate


@dataclass(frozen=True, eq=False)
class SlamEstimate(LocalizationEstimate):
    """The estimate of SLAM; the covariance is relative to the nearby map.

    ``loop_closures``: number found so far.
    """

    loop_closures: int = 0


@dataclass(frozen=True, eq=False)
class SlamTrajectory:
    """The believed base poses of the keyframes.

    ``poses``: (N, 3) x, y in metres, theta in radians, map frame. ``stamps``: (N,) seconds of the scans. ``loops``: (K,
    2) indices of keyframes connected by a loop closure.
    """

    poses: NDArray[np.float64]
    stamps: NDArray[np.float64]
    loops: NDArray[np.intp]

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", frozen_array(self.poses, (None, 3), "SlamTrajectory poses"))
        object.__setattr__(self, "stamps", frozen_array(self.stamps, (len(self.poses),), "SlamTrajectory stamps"))
        object.__setattr__(self, "loops", frozen_array(self.loops, (None, 2), "SlamTrajectory loops", np.intp))


class Slam(ABC):
    """Simultaneous localisation and mapping: call ``reset`` once, then ``add`` for each scan, and ``predict`` in
    between.
    """

    @abstractmethod
    def reset(self, pose: Pose2D, odometry: Pose2D) -> SlamEstimate:
        """Start a new map, in whose frame the base is at ``pose``."""

    @abstractmethod
    def predict(self, odometry: Pose2D) -> SlamEstimate:
        """Move the estimate by the change of the odometry pose (``odom`` frame) since the last call."""

    @abstractmethod
    def add(self, odometry: Pose2D, scan: LaserScan, base_from_lidar: Pose2D) -> SlamEstimate:
        """Process a scan taken at the odometry pose ``odometry`` (``odom`` frame)."""

    @property
    @abstractmethod
    def estimate(self) -> SlamEstimate:
        """The current estimate. Raises RuntimeError before ``reset``."""

    @property
    @abstractmethod
    def grid(self) -> OccupancyGrid:
        """The current map; empty before the first scan."""

    @property
    @abstractmethod
    def trajectory(self) -> SlamTrajectory:
        """The current keyframes."""
