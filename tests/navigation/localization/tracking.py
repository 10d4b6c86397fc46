"""A localizer with its latest estimate, as the base's controller keeps it."""

from __future__ import annotations

from typing import Any

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.localization.base import Localizer


class Tracking:
    """``estimate``: what ``localizer`` returned last."""

    def __init__(self, localizer: Localizer, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float):
        self.localizer = localizer
        self.estimate: Any = localizer.start(pose, odometry, position_std, heading_std)

    def predict(self, odometry: Pose2D) -> Any:
        self.estimate = self.localizer.predict(self.estimate, odometry)
        return self.estimate

    def correct(self, scan: LaserScan, base_from_lidar: Pose2D) -> Any:
        self.estimate = self.localizer.correct(self.estimate, scan, base_from_lidar)
        return self.estimate
