"""Exact distances in the plane, for many points at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def squared_distance_to_segment(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """For ``points`` (2, N), a row each for x and y: faster than (N, 2)."""
    (dx, dy), (along_x, along_y) = points - start[:, None], end - start
    share = np.clip((dx * along_x + dy * along_y) / max(float(along_x**2 + along_y**2), 1e-12), 0.0, 1.0)
    squared: NDArray[np.float64] = (dx - share * along_x) ** 2 + (dy - share * along_y) ** 2
    return squared


def distance_to_polygon(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance of ``points`` (2, N) to a convex, counter-clockwise polygon (M, 2); negative inside."""
    squared = np.full(points.shape[1], np.inf)
    depth = np.full(points.shape[1], -np.inf)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([end[1] - start[1], start[0] - end[0]]) / np.linalg.norm(end - start)
        np.maximum(depth, normal @ points - normal @ start, out=depth)
        np.minimum(squared, squared_distance_to_segment(points, start, end), out=squared)
    return np.where(depth < 0.0, depth, np.sqrt(squared))
