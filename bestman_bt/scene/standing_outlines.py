"""What stands on the floor, seen from above: what a start, a goal or somebody who walks keeps away from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull

from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.scene.plane_geometry import Points, rectangle, wall_rectangle
from bestman_bt.scene.scene import PlacedFurniture, Wall

_OVERHEAD = 1.8
"""Metres above the floor from which on nobody meets a board, such as the lintel of a door."""


def standing_outlines(walls: Iterable[Wall], furniture: Iterable[PlacedFurniture]) -> list[Points]:
    """Convex polygons, counter-clockwise: walls, footprints, frames of doors between rooms, and open leaves."""
    pieces = list(furniture)
    outlines = [wall_rectangle(wall) for wall in walls]
    for piece in pieces:
        outlines += body_outlines(piece)
    return [*outlines, *(outline for piece in pieces for outline in leaf_outlines(piece))]


def body_outlines(piece: PlacedFurniture) -> list[Points]:
    """The footprint of a piece, or the posts of a door between rooms."""
    if piece.model.is_passage:
        return list(_outlines(piece.model.parts, piece.pose))
    return [rectangle(piece.actual, piece.model.footprint)]


def leaf_outlines(piece: PlacedFurniture) -> Iterator[Points]:
    """The boards of open doors and drawers, and of a door between rooms also while it is closed."""
    for leaf in piece.model.articulations:
        position = piece.open.get(leaf.name, 0.0)
        if position > 0.0 or piece.model.is_passage:
            yield from _outlines(leaf.parts, piece.pose @ leaf.moved(position))


def _outlines(parts: Iterable[PlacedShape], map_from_parts: Pose) -> Iterator[Points]:
    for part in parts:
        if isinstance(part.shape, Box):
            box = np.array(list(product((-0.5, 0.5), repeat=3))) * part.shape.size
            corners = (map_from_parts @ part.pose).apply(box)
            if corners[:, 2].min() < _OVERHEAD:
                yield corners[ConvexHull(corners[:, :2]).vertices, :2]
