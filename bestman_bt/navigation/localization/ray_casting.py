"""Simulation of a planar lidar in a map of segments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D


def cast_rays(
    segments: NDArray[np.float64], pose: Pose2D, angles: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the distance (N,) from ``pose`` along ``angles`` (N,), in its frame, to the first of ``segments`` (M, 4),
    and its index.

    Without a hit, the distance is infinite and the index -1.
    """
    if len(segments) == 0:
        return np.full(len(angles), np.inf), np.full(len(angles), -1)
    heading = angles + pose.theta
    rays = np.column_stack([np.cos(heading), np.sin(heading)])
    start = segments[:, :2] - (pose.x, pose.y)
    along = segments[:, 2:] - segments[:, :2]
    # Solve pose + t ray = start + u along for each pair by Cramer's rule.
    determinant = along[:, 0] * rays[:, 1, None] - along[:, 1] * rays[:, 0, None]
    safe = np.where(np.abs(determinant) < 1e-12, 1.0, determinant)
    t = (along[:, 0] * start[:, 1] - along[:, 1] * start[:, 0]) / safe
    u = (rays[:, 0, None] * start[:, 1] - rays[:, 1, None] * start[:, 0]) / safe
    hit = (np.abs(determinant) >= 1e-12) & (t > 0.0) & (u >= 0.0) & (u <= 1.0)
    distance = np.where(hit, t, np.inf)
    index = np.argmin(distance, axis=1)
    nearest = distance[np.arange(len(rays)), index]
    return nearest, np.where(np.isfinite(nearest), index, -1)
