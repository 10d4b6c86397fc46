"""What a localizer predicts with: the odometry of the wheels, or what a filter makes of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from bestman_bt.messages import Pose2D


class OdometryFilter(ABC):
    """Turns the wheels' odometry into a better one; ``uses_gyro``: whether it needs a gyroscope for that."""

    uses_gyro: ClassVar[bool]

    @abstractmethod
    def reset(self, odometry: Pose2D) -> None:
        """Begin at the pose that the wheels have counted so far (``odom`` frame)."""

    @abstractmethod
    def update(self, odometry: Pose2D, turned: float, elapsed: float) -> Pose2D:
        """The filtered pose, after the wheels have counted up to ``odometry`` (``odom`` frame, as they count it).

        ``turned``: what the gyroscope has felt in the ``elapsed`` seconds since the last call, radians, with its bias.
        """


class WheelOdometry(OdometryFilter):
    """The wheels' odometry as it is."""

    uses_gyro: ClassVar[bool] = False

    def reset(self, odometry: Pose2D) -> None:
        """See ``OdometryFilter.reset``."""

    def update(self, odometry: Pose2D, turned: float, elapsed: float) -> Pose2D:
        """See ``OdometryFilter.update``."""
        return odometry
