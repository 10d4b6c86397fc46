"""SLAM in the place of a localizer: the base controller drives on the map that is being made."""

from __future__ import annotations

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.localization import LocalizationEstimate, Localizer
from bestman_bt.navigation.slam.base import Slam, SlamEstimate


class SlamLocalizer(Localizer):
    """Feeds ``slam``; the map's frame is the one in which the base is believed to be at ``reset``."""

    def __init__(self, slam: Slam) -> None:
        self._slam = slam
        self._odometry = Pose2D()

    @property
    def estimate(self) -> SlamEstimate:
        """See ``Localizer.estimate``."""
        return self._slam.estimate

    def reset(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> LocalizationEstimate:
        """See ``Localizer.reset``; a new map begins, on which the base is exactly at ``pose``."""
        self._odometry = odometry
        return self._slam.reset(pose, odometry)

    def predict(self, odometry: Pose2D) -> LocalizationEstimate:
        """See ``Localizer.predict``."""
        self._odometry = odometry
        return self._slam.predict(odometry)

    def correct(self, scan: LaserScan, base_from_lidar: Pose2D) -> LocalizationEstimate:
        """See ``Localizer.correct``."""
        return self._slam.add(self._odometry, scan, base_from_lidar)
