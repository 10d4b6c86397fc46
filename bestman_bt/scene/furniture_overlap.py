"""Furniture that stands in other furniture: its solids compared as upright prisms, part by part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.messages import Box, Cylinder, Mesh, Pose, Shape, Sphere
from bestman_bt.scene.plane_geometry import Points, overlap_depth
from bestman_bt.scene.scene import PlacedFurniture

TOLERANCE = 0.005
"""Metres by which solids may reach into each other: what touches or stands on something else is no fault."""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)


@dataclass(frozen=True, eq=False)
class _Prism:
    """What a part covers seen from above (N, 2), convex and counter-clockwise, and between which heights, metres."""

    outline: Points
    bottom: float
    top: float


def furniture_overlaps(pieces: Sequence[PlacedFurniture]) -> Iterator[tuple[str, str, float]]:
    """Each two pieces, in their order, that overlap by more than ``TOLERANCE``, and by how much, metres.

    Pieces stand where the map has them, doors and drawers open as at the start. A part that stands upright is taken
    as it is, one that leans as the prism around it.
    """
    solids = {piece.name: list(_prisms(piece)) for piece in pieces}
    for index, later in enumerate(pieces):
        for earlier in pieces[:index]:
            depth = max((_depth(a, b) for a, b in product(solids[earlier.name], solids[later.name])), default=0.0)
            if depth > TOLERANCE:
                yield earlier.name, later.name, depth


def _depth(a: _Prism, b: _Prism) -> float:
    upright = min(a.top, b.top) - max(a.bottom, b.bottom)
    return min(upright, overlap_depth(a.outline, b.outline)) if upright > TOLERANCE else 0.0


def _prisms(piece: PlacedFurniture) -> Iterator[_Prism]:
    frame = piece.nominal.to_pose(piece.elevation)
    bodies = [(frame, piece.model.parts)]
    bodies += [(frame @ leaf.moved(piece.open.get(leaf.name, 0.0)), leaf.parts) for leaf in piece.model.articulations]
    for body, parts in bodies:
        for part in parts:
            yield _prism(part.shape, body @ part.pose)


def _prism(shape: Shape, pose: Pose) -> _Prism:
    points = pose.apply(_outermost(shape))
    outline = points[ConvexHull(points[:, :2]).vertices, :2]
    return _Prism(outline, float(points[:, 2].min()), float(points[:, 2].max()))


def _outermost(shape: Shape) -> NDArray[np.float64]:
    """Points (N, 3) whose hull is that of the shape, in its frame; round ones by points on their rims."""
    rim = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), np.zeros_like(_CIRCLE)])
    match shape:
        case Box():
            return np.array(list(product((-0.5, 0.5), repeat=3))) * shape.size
        case Cylinder():
            ends = [shape.radius * rim + (0.0, 0.0, z) for z in (-shape.length / 2, shape.length / 2)]
            return np.concatenate(ends)
        case Sphere():
            return shape.radius * np.concatenate([rim, rim[:, [1, 2, 0]], rim[:, [2, 0, 1]]])
        case Mesh():
            return shape.vertices
