"""How uncertain poses in the plane are: covariances (3, 3) of x, y, theta in m², m rad, rad²."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, wrap_angle

WEAK_PRIOR = 1e-6 * np.eye(3)
"""Information that is next to none: directions that no hit constrains get a huge, finite variance."""


class OdometryNoise(Protocol):
    """Variance that odometry gains; the parameters of a localizer that holds a covariance say how much."""

    @property
    def slip(self) -> float:
        """Of the position, per metre driven, m²/m."""

    @property
    def turn_slip(self) -> float:
        """Of the heading, per radian turned, rad²/rad."""

    @property
    def turn_shift(self) -> float:
        """Of the position, per radian turned, m²/rad."""

    @property
    def drift(self) -> float:
        """Of the heading, per metre driven, rad²/m."""


def driven_on(
    pose: Pose2D, covariance: NDArray[np.float64], moved: Pose2D, noise: OdometryNoise
) -> tuple[Pose2D, NDArray[np.float64]]:
    """Return the pose and its covariance after the odometry has counted ``moved``, in the base frame."""
    distance = math.hypot(moved.x, moved.y)
    after = pose @ moved
    jacobian = np.eye(3)
    jacobian[:2, 2] = pose.y - after.y, after.x - pose.x
    turn = abs(moved.theta)
    gained = [noise.slip * distance + noise.turn_shift * turn] * 2 + [noise.turn_slip * turn + noise.drift * distance]
    return after, jacobian @ covariance @ jacobian.T + np.diag(gained)


def turned(covariance: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return a covariance in a frame in which the vectors of its own appear turned by ``angle``."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    result: NDArray[np.float64] = turn @ covariance @ turn.T
    return result


def inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Information of a covariance, and the other way round."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def difference(pose: Pose2D, from_pose: Pose2D) -> NDArray[np.float64]:
    """x, y and theta of one pose less those of another in the same frame, (3,); the angle within a half turn."""
    return np.array([pose.x - from_pose.x, pose.y - from_pose.y, wrap_angle(pose.theta - from_pose.theta)])


def deviation(off: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Return how many standard deviations a difference (3,) amounts to (Mahalanobis)."""
    return math.sqrt(float(off @ np.linalg.solve(covariance, off)))


def worst_position_std(covariance: NDArray[np.float64]) -> float:
    """Standard deviation of the position along the worst direction, metres."""
    (xx, xy), (_, yy) = covariance[:2, :2].tolist()
    return math.sqrt((xx + yy) / 2.0 + math.hypot((xx - yy) / 2.0, xy))  # the larger eigenvalue of a 2 x 2 matrix
