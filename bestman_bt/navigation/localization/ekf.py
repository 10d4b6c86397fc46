"""Fusion of wheel odometry and gyroscope: an extended Kalman filter with the gyroscope's bias.

As in robot_localization (T. Moore, D. Stouch, 2014), with a state (x, y, heading, rate, bias): wheels measure the rate,
inaccurately when they slip; the gyroscope measures it well, except for its bias. Only the wheels measure the distance.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.messages.shapes import NonNegative, Positive


@dataclass(frozen=True, eq=False)
class OdometryEstimate:
    """The estimate of a filter after an update; ``pose``: in the ``odom`` frame."""

    pose: Pose2D


class OdometryFilter(ABC):
    """Improves the wheel odometry; ``uses_gyro``: whether the filter needs a gyroscope."""

    uses_gyro: ClassVar[bool]

    @abstractmethod
    def start(self, odometry: Pose2D) -> OdometryEstimate:
        """Return the first estimate, at the current wheel odometry, a pose in the ``odom`` frame."""

    @abstractmethod
    def update(self, before: Any, odometry: Pose2D, turned: float, elapsed: float) -> OdometryEstimate:
        """Return the next estimate; ``before``: the last one. ``odometry``: pose from wheel odometry, ``odom`` frame.

        ``turned``: rotation measured by the gyroscope in the ``elapsed`` seconds since the last one, radians, bias
        included.
        """


@dataclass(frozen=True)
class WheelOdometry(OdometryFilter):
    """Passes the wheel odometry through without filtering."""

    uses_gyro: ClassVar[bool] = False

    @override
    def start(self, odometry: Pose2D) -> OdometryEstimate:
        return OdometryEstimate(odometry)

    @override
    def update(self, before: OdometryEstimate, odometry: Pose2D, turned: float, elapsed: float) -> OdometryEstimate:
        return OdometryEstimate(odometry)


@dataclass(frozen=True, eq=False)
class EkfEstimate(OdometryEstimate):
    """``wheels``: their odometry then. ``state``: (5,) x, y, heading, rate and bias, with its ``covariance`` (5, 5);
    metres, radians, seconds.
    """

    wheels: Pose2D
    state: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @property
    def bias(self) -> float:
        """The bias of the gyroscope, rad/s."""
        return float(self.state[4])


@dataclass(frozen=True)
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

    @override
    def start(self, odometry: Pose2D) -> EkfEstimate:
        """Return the first estimate; the base should be at rest."""
        state = np.array([odometry.x, odometry.y, odometry.theta, 0.0, 0.0])
        covariance = np.diag([0.0, 0.0, 0.0, 1e-6, self.bias_std**2])
        return _estimate(odometry.checked("OdometryEkf odometry"), state, covariance)

    @override
    def update(self, before: EkfEstimate, odometry: Pose2D, turned: float, elapsed: float) -> EkfEstimate:
        for value, what in ((turned, "turned"), (elapsed, "elapsed")):
            if not math.isfinite(value):
                raise ValueError(f"OdometryEkf {what} is {value:g}; it should be finite")
        odometry.checked("OdometryEkf odometry")
        if elapsed <= 0.0:
            return before
        wheels = before.wheels.inverse() @ odometry
        distance = math.hypot(wheels.x, wheels.y)
        covariance = before.covariance.copy()
        covariance[3, 3] += (self.acceleration * elapsed) ** 2
        covariance[4, 4] += self.bias_walk**2 * elapsed
        wheel_std = (self.turn_slip * abs(wheels.theta) + self.drive_slip * distance) / elapsed + self.wheel_std
        gyro_std = self.gyro_noise / math.sqrt(elapsed)
        rate_and_bias, rate = np.array([0.0, 0.0, 0.0, 1.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0, 0.0])
        state, covariance = _measured(before.state, covariance, rate_and_bias, turned / elapsed, gyro_std)
        state, covariance = _measured(state, covariance, rate, wheels.theta / elapsed, wheel_std, self.gate)
        return _estimate(odometry, *self._moved(state, covariance, wheels, distance, elapsed))

    def _moved(
        self,
        state: NDArray[np.float64],
        covariance: NDArray[np.float64],
        wheels: Pose2D,
        distance: float,
        elapsed: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Drive what the wheels say along the mean heading of the step, and turn at the rate."""
        turn = state[3] * elapsed
        # The wheels count along the arc that they think they drive; its chord is turned by half of their own angle.
        heading = state[2] + turn / 2.0
        chord = math.atan2(wheels.y, wheels.x) - wheels.theta / 2.0
        dx, dy = distance * math.cos(heading + chord), distance * math.sin(heading + chord)
        jacobian = np.eye(5)
        jacobian[0, 2], jacobian[1, 2] = -dy, dx
        jacobian[0, 3], jacobian[1, 3] = -dy * elapsed / 2.0, dx * elapsed / 2.0
        jacobian[2, 3] = elapsed
        covariance = jacobian @ covariance @ jacobian.T
        driven = np.array([math.cos(heading + chord), math.sin(heading + chord)])
        covariance[:2, :2] += (self.slip * distance) ** 2 * np.outer(driven, driven)
        return state + np.array([dx, dy, turn, 0.0, 0.0]), covariance


def _estimate(wheels: Pose2D, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> EkfEstimate:
    x, y, theta = state[:3].tolist()
    return EkfEstimate(Pose2D(x, y, wrap_angle(theta)), wheels, state, covariance)


def _measured(
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
    row: NDArray[np.float64],
    value: float,
    std: float,
    gate: float = math.inf,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    innovation = value - row @ state
    projected = covariance @ row
    variance = float(row @ projected) + std**2
    if innovation**2 > gate**2 * variance:
        return state, covariance
    gain = projected / variance
    keep = np.eye(5) - np.outer(gain, row)
    return state + gain * innovation, keep @ covariance @ keep.T + std**2 * np.outer(gain, gain)
