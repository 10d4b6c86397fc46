"""How far points are from a shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.shapes import Box, Cylinder, Mesh, PlacedShape, Sphere


def distance_to_shape(points: NDArray[np.float64], placed: PlacedShape) -> NDArray[np.float64]:
    """Distances (N,) of points (N, 3) from a solid shape, metres, 0 inside; a mesh counts as its bounding box."""
    local = placed.pose.inverse().apply(points)
    shape = placed.shape
    match shape:
        case Sphere():
            outside: NDArray[np.float64] = np.maximum(np.linalg.norm(local, axis=1) - shape.radius, 0.0)
            return outside
        case Cylinder():
            radial = np.hypot(local[:, 0], local[:, 1]) - shape.radius
            along = np.abs(local[:, 2]) - shape.length / 2
            beyond: NDArray[np.float64] = np.hypot(np.maximum(radial, 0.0), np.maximum(along, 0.0))
            return beyond
        case Box():
            half = np.array(shape.size) / 2
        case Mesh():
            lower, upper = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
            local, half = local - (lower + upper) / 2, (upper - lower) / 2
    distances: NDArray[np.float64] = np.linalg.norm(np.maximum(np.abs(local) - half, 0.0), axis=1)
    return distances
