"""Base odometry fused with a gyroscope."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.localization.ekf import OdometryFilter
from hal.api import Clock, Imu, MobileBase, Timer


class GyroHeading:
    """Integrates the rate about ``axis`` (3,), the vertical in the sensor frame, between ``begin`` and ``end``."""

    def __init__(self, imu: Imu, clock: Clock, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> None:
        self._imu, self._clock = imu, clock
        self._axis: NDArray[np.float64] = np.array(axis) / np.linalg.norm(axis)
        self._bias = self._heading = self._summed = 0.0
        self._stamp = self._began = 0.0
        self._timer: Timer | None = None

    @property
    def heading(self) -> float:
        """Return the unwrapped heading since ``begin`` or ``level``, radians, counter-clockwise positive."""
        return self._heading

    def begin(self) -> None:
        """Start integrating, at rest: readings until ``level`` determine the bias."""
        self.end()
        self._bias = self._heading = self._summed = 0.0
        self._stamp = self._began = self._imu.read().stamp
        self._timer = self._clock.every(1.0 / 240.0, self._take)

    def level(self) -> None:
        """Use the readings since ``begin`` as the bias; the heading is 0 from now on."""
        if self._stamp > self._began:
            self._bias = self._summed / (self._stamp - self._began)
        self._heading = 0.0

    def end(self) -> None:
        """Stop integrating; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _take(self) -> None:
        reading = self._imu.read()
        elapsed = reading.stamp - self._stamp
        if elapsed <= 0.0:
            return
        self._stamp = reading.stamp
        turned = float(reading.angular_velocity @ self._axis) * elapsed
        self._summed += turned
        self._heading += turned - self._bias * elapsed


class FusedOdometry:
    """Odometry for localizers, instead of the base's own. ``gyro``: the gyroscope, if the filter uses one."""

    def __init__(
        self, base: MobileBase, clock: Clock, odometry_filter: OdometryFilter, gyro: GyroHeading | None = None
    ) -> None:
        if odometry_filter.uses_gyro and gyro is None:
            raise ValueError(f"{type(odometry_filter).__name__} needs a gyroscope")
        self._base, self._clock, self._filter = base, clock, odometry_filter
        self._gyro = gyro if odometry_filter.uses_gyro else None
        self._felt = self._time = 0.0

    def begin(self) -> None:
        """Start the gyroscope; the base should be at rest."""
        if self._gyro is not None:
            self._gyro.begin()
        self._felt, self._time = 0.0, self._clock.now()
        self._estimate = self._filter.start(self._base.odometry())

    def pose(self) -> Pose2D:
        """Return the current pose in the ``odom`` frame, metres and radians."""
        felt, now = self._gyro.heading if self._gyro is not None else 0.0, self._clock.now()
        turned, elapsed = felt - self._felt, now - self._time
        self._felt, self._time = felt, now
        self._estimate = self._filter.update(self._estimate, self._base.odometry(), turned, elapsed)
        return self._estimate.pose

    def end(self) -> None:
        """Stop the gyroscope; idempotent."""
        if self._gyro is not None:
            self._gyro.end()
