"""Odometry of a base, with what its gyroscope feels where a filter wants to know."""

from __future__ import annotations

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.localization import OdometryFilter
from bestman_bt.sensing.inertial.gyro_heading import GyroHeading
from hal.api import Clock, MobileBase


class FusedOdometry:
    """What any localizer predicts with, in place of the base's own odometry. ``gyro``: if the filter uses it."""

    def __init__(
        self, base: MobileBase, clock: Clock, odometry_filter: OdometryFilter, gyro: GyroHeading | None = None
    ) -> None:
        if odometry_filter.uses_gyro and gyro is None:
            raise ValueError(f"{type(odometry_filter).__name__} needs a gyroscope")
        self._base, self._clock, self._filter = base, clock, odometry_filter
        self._gyro = gyro if odometry_filter.uses_gyro else None
        self._felt = self._time = 0.0

    def begin(self) -> None:
        """Begin to feel; the base should rest."""
        if self._gyro is not None:
            self._gyro.begin()
        self._felt, self._time = 0.0, self._clock.now()
        self._filter.reset(self._base.odometry())

    def pose(self) -> Pose2D:
        """Pose in the ``odom`` frame, now."""
        felt, now = self._gyro.heading if self._gyro is not None else 0.0, self._clock.now()
        turned, elapsed = felt - self._felt, now - self._time
        self._felt, self._time = felt, now
        return self._filter.update(self._base.odometry(), turned, elapsed)

    def end(self) -> None:
        """Feel no further; idempotent."""
        if self._gyro is not None:
            self._gyro.end()
