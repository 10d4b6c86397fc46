"""Uncertainty of planar poses: covariances (3, 3) of x, y, theta in m², m rad, rad²."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, wrap_angle

WEAK_PRIOR = 1e-6 * np.eye(3)
"""Almost zero information: directions that no hit constrains get a huge but finite variance."""


class OdometryNoise(Protocol):
    """Variance gained by odometry, from the parameters of a localizer."""

    @property
    def slip(self) -> float:
        """Return the variance of the position per metre driven, m²/m."""

    @property
    def turn_slip(self) -> float:
        """Return the variance of the heading per radian turned, rad²/rad."""

    @property
    def turn_shift(self) -> float:
        """Return the variance of the position per radian turned, m²/rad."""

    @property
    def drift(self) -> float:
        """Return the variance of the heading per metre driven, rad²/m."""


def driven_on(
    pose: Pose2D, covariance: NDArray[np.float64], moved: Pose2D, noise: OdometryNoise
) -> tuple[Pose2D, NDArray[np.float64]]:
    """Return the pose and its covariance after the odometry motion ``moved``, in the base frame."""
    distance = math.hypot(moved.x, moved.y)
    after = pose @ moved
    jacobian = np.eye(3)
    jacobian[:2, 2] = pose.y - after.y, after.x - pose.x
    turn = abs(moved.theta)
    gained = [noise.slip * distance + noise.turn_shift * turn] * 2 + [noise.turn_slip * turn + noise.drift * distance]
    return after, jacobian @ covariance @ jacobian.T + np.diag(gained)


def turned(covariance: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return a covariance rotated by ``angle``, radians."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    result: NDArray[np.float64] = turn @ covariance @ turn.T
    return result


def inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of a (3, 3) covariance or information matrix."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def difference(pose: Pose2D, from_pose: Pose2D) -> NDArray[np.float64]:
    """Return x, y and theta of one pose minus those of another in the same frame, (3,); the angle in [-π, π)."""
    return np.array([pose.x - from_pose.x, pose.y - from_pose.y, wrap_angle(pose.theta - from_pose.theta)])


def deviation(off: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Return the Mahalanobis distance of a difference (3,)."""
    return math.sqrt(float(off @ np.linalg.solve(covariance, off)))


def worst_position_std(covariance: NDArray[np.float64]) -> float:
    """Return the standard deviation of the position along the worst direction, metres."""
    (xx, xy), (_, yy) = covariance[:2, :2].tolist()
    return math.sqrt((xx + yy) / 2.0 + math.hypot((xx - yy) / 2.0, xy))  # the larger eigenvalue of a 2 x 2 matrix
