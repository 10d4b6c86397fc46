"""Fusion of wheel odometry and gyroscope: an extended Kalman filter with the gyroscope's bias.

As in robot_localization (T. Moore, D. Stouch, 2014), with a state (x, y, heading, rate, bias): wheels measure the rate,
inaccurately when they slip; the gyroscope measures it well, except for its bias. Only the wheels measure the distance.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.messages.shapes import NonNegative, Positive

# What a localizer predicts with: the odometry of the wheels, or what a filter makes of it.


class OdometryFilter(ABC):
    """Improves the wheel odometry; ``uses_gyro``: whether the filter needs a gyroscope."""

    uses_gyro: ClassVar[bool]

    @abstractmethod
    def reset(self, odometry: Pose2D) -> None:
        """Start at the current wheel odometry, a pose in the ``odom`` frame."""

    @abstractmethod
    def update(self, odometry: Pose2D, turned: float, elapsed: float) -> Pose2D:
        """Return the filtered pose in the ``odom`` frame; ``odometry``: pose from wheel odometry in that frame.

        ``turned``: rotation measured by the gyroscope in the ``elapsed`` seconds since the last call, radians, bias
        included.
        """


class WheelOdometry(OdometryFilter):
    """The wheels' odometry as it is."""

    uses_gyro: ClassVar[bool] = False

    def reset(self, odometry: Pose2D) -> None:
        """Do nothing: the odometry is used unchanged."""

    def update(self, odometry: Pose2D, turned: float, elapsed: float) -> Pose2D:
        """Return ``odometry`` unchanged."""
        return odometry


@dataclass(eq=False)
class OdometryEkf(OdometryFilter):
    """Wheels and gyroscope in one estimate with its uncertainty.

    ``acceleration``: rad/s², standard deviation of the change of rate within a step, per second. ``turn_slip``:
    relative error of a turn by the wheels, ``drive_slip``: undetected rotation per metre, radians, ``wheel_std``: rad/s
    at rest. ``slip``: relative error of a distance. ``gyro_noise``: rad/sqrt(s), of the integrated rate. ``bias_std``:
    rad/s, of the initial bias, ``bias_walk``: rad/s per sqrt(s). ``gate``: standard deviations beyond which the wheels'
    rotation is rejected as slip.
    """

    acceleration: Annotated[Positive, "rad/s²"] = 8.0
    turn_slip: NonNegative = 0.1
    drive_slip: Annotated[NonNegative, "rad/m"] = 0.15
    wheel_std: Annotated[Positive, "rad/s"] = 0.002
    slip: NonNegative = 0.1
    gyro_noise: Annotated[Positive, "rad/√s"] = 0.0005
    bias_std: Annotated[NonNegative, "rad/s"] = 0.005
    bias_walk: Annotated[NonNegative, "rad/s/√s"] = 2e-5
    gate: Positive = 5.0

    uses_gyro: ClassVar[bool] = True

    def __post_init__(self) -> None:
        self.reset(Pose2D())

    def reset(self, odometry: Pose2D) -> None:
        """Start at the current wheel odometry; the base should be at rest."""
        self._wheels = odometry.checked("OdometryEkf odometry")
        self._state = np.array([odometry.x, odometry.y, odometry.theta, 0.0, 0.0])
        self._covariance = np.diag([0.0, 0.0, 0.0, 1e-6, self.bias_std**2])

    @property
    def bias(self) -> float:
        """The bias of the gyroscope, rad/s."""
        return float(self._state[4])

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(5, 5), of x, y, heading, rate and bias; metres, radians, seconds."""
        return self._covariance

    def update(self, odometry: Pose2D, turned: float, elapsed: float) -> Pose2D:
        """Return the filtered pose; see ``OdometryFilter.update``."""
        for value, what in ((turned, "turned"), (elapsed, "elapsed")):
            if not math.isfinite(value):
                raise ValueError(f"OdometryEkf {what} is {value:g}; it should be finite")
        odometry.checked("OdometryEkf odometry")
        if elapsed > 0.0:
            wheels = self._wheels.inverse() @ odometry
            self._wheels = odometry
            self._step(wheels, turned, elapsed)
        x, y, theta = self._state[:3].tolist()
        return Pose2D(x, y, wrap_angle(theta))

    def _step(self, wheels: Pose2D, turned: float, elapsed: float) -> None:
        distance = math.hypot(wheels.x, wheels.y)
        self._covariance[3, 3] += (self.acceleration * elapsed) ** 2
        self._covariance[4, 4] += self.bias_walk**2 * elapsed
        wheel_std = (self.turn_slip * abs(wheels.theta) + self.drive_slip * distance) / elapsed + self.wheel_std
        gyro_std = self.gyro_noise / math.sqrt(elapsed)
        self._measure(np.array([0.0, 0.0, 0.0, 1.0, 1.0]), turned / elapsed, gyro_std)
        self._measure(np.array([0.0, 0.0, 0.0, 1.0, 0.0]), wheels.theta / elapsed, wheel_std, self.gate)
        self._move(wheels, distance, elapsed)

    def _move(self, wheels: Pose2D, distance: float, elapsed: float) -> None:
        """Drive what the wheels say along the mean heading of the step, and turn at the rate."""
        turn = self._state[3] * elapsed
        # The wheels count along the arc that they think they drive; its chord is turned by half of their own angle.
        heading = self._state[2] + turn / 2.0
        chord = math.atan2(wheels.y, wheels.x) - wheels.theta / 2.0
        dx, dy = distance * math.cos(heading + chord), distance * math.sin(heading + chord)
        jacobian = np.eye(5)
        jacobian[0, 2], jacobian[1, 2] = -dy, dx
        jacobian[0, 3], jacobian[1, 3] = -dy * elapsed / 2.0, dx * elapsed / 2.0
        jacobian[2, 3] = elapsed
        self._state[:3] += (dx, dy, turn)
        self._covariance = jacobian @ self._covariance @ jacobian.T
        driven = np.array([math.cos(heading + chord), math.sin(heading + chord)])
        self._covariance[:2, :2] += (self.slip * distance) ** 2 * np.outer(driven, driven)

    def _measure(self, row: NDArray[np.float64], value: float, std: float, gate: float = math.inf) -> None:
        innovation = value - row @ self._state
        projected = self._covariance @ row
        variance = float(row @ projected) + std**2
        if innovation**2 > gate**2 * variance:
            return
        gain = projected / variance
        self._state = self._state + gain * innovation
        keep = np.eye(5) - np.outer(gain, row)
        self._covariance = keep @ self._covariance @ keep.T + std**2 * np.outer(gain, gain)
