"""What a camera could see of sampled surfaces: not what the surface itself or another body hides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Sphere

FACING = 0.15
"""Least cosine between normal and line of sight: surface seen flatter than that gives no depth."""


def unobstructed(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    eyes: NDArray[np.float64],
    cell: float,
    thickness: float = 0.010,
) -> NDArray[np.bool_]:
    """Which samples (C, S) of one body each of the eyes (C, 3) sees: they face it, and no other sample is before them.

    ``points``, ``normals``: (S, 3), metres. ``cell``: width of the cells of the depth buffer at the body's distance,
    metres: a little more than the samples are apart. ``thickness``: how much nearer another sample must be.
    """
    # Products of matrices throughout: (C, 3) by (3, S).
    squares = (eyes**2).sum(axis=1)[:, None] - 2.0 * eyes @ points.T + (points**2).sum(axis=1)
    towards_eye = eyes @ normals.T - (points * normals).sum(axis=1)
    facing = towards_eye > FACING * np.sqrt(np.maximum(0.0, squares))
    middle = points.mean(axis=0)
    ahead = middle - eyes
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.cross(ahead, np.where(np.abs(ahead[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, ahead)
    depth = _along(ahead, points, eyes)
    scale = np.linalg.norm(middle - eyes, axis=1)[:, None] / np.maximum(depth, 1e-3) / cell
    u = np.floor(_along(side, points, eyes) * scale).astype(np.intp)
    v = np.floor(_along(up, points, eyes) * scale).astype(np.intp)
    u -= u.min()
    v -= v.min()
    width, height = int(u.max()) + 1, int(v.max()) + 1
    cells = (np.arange(len(eyes))[:, None] * height + v) * width + u
    nearest = np.full(len(eyes) * height * width, np.inf)
    np.minimum.at(nearest, cells.ravel(), depth.ravel())
    visible: NDArray[np.bool_] = facing & (depth < nearest[cells] + thickness) & (depth > 1e-3)
    return visible


def _along(
    directions: NDArray[np.float64], points: NDArray[np.float64], eyes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(C, S): how far each point lies from each eye along its direction (C, 3)."""
    along: NDArray[np.float64] = directions @ points.T - (directions * eyes).sum(axis=1, keepdims=True)
    return along


def hidden_by_shapes(
    points: NDArray[np.float64], eyes: NDArray[np.float64], shapes: Sequence[PlacedShape]
) -> NDArray[np.bool_]:
    """Which points (S, 3) the boxes around ``shapes`` hide from each of the eyes (C, 3): (C, S); all in one frame.

    By slabs: Kay and Kajiya, "Ray Tracing Complex Scenes", 1986.
    """
    hidden = np.zeros((len(eyes), len(points)), dtype=bool)
    for placed in shapes:
        lower, upper = _bounds(placed)
        shape_from_frame = placed.pose.inverse()
        starts, ends = shape_from_frame.apply(eyes), shape_from_frame.apply(points)
        enters, leaves = np.full(hidden.shape, -np.inf), np.full(hidden.shape, np.inf)
        for axis in range(3):
            along = ends[None, :, axis] - starts[:, None, axis]
            along = np.where(np.abs(along) < 1e-9, 1e-9, along)
            one, other = ((side[axis] - starts[:, None, axis]) / along for side in (lower, upper))
            enters = np.maximum(enters, np.minimum(one, other))
            leaves = np.minimum(leaves, np.maximum(one, other))
        hidden |= (enters < leaves) & (leaves > 0.0) & (enters < 0.999)
    return hidden


def _bounds(placed: PlacedShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    shape = placed.shape
    match shape:
        case Box():
            half = np.array(shape.size) / 2
        case Cylinder():
            half = np.array([shape.radius, shape.radius, shape.length / 2])
        case Sphere():
            half = np.full(3, shape.radius)
        case Mesh():
            return shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    return -half, half
