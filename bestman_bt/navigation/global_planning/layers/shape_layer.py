"""Bodies in space, as far as a robot on the floor can meet them: what was seen, doors where they are believed to be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Sphere
from bestman_bt.navigation.global_planning.layers.base import CostmapLayer
from bestman_bt.navigation.global_planning.layers.plane_distance import distance_to_polygon


@dataclass(frozen=True, eq=False)
class ShapeLayer(CostmapLayer):
    """The outlines of ``shapes`` in the map frame, seen from above.

    Those that end below ``floor_height`` or begin above ``robot_height``, metres, are left out.
    """

    shapes: Sequence[PlacedShape]
    floor_height: float
    robot_height: float

    def reaching(self, height: float) -> ShapeLayer:
        """Without the shapes that end below."""
        return replace(self, floor_height=max(self.floor_height, height))

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See the base class."""
        distance = np.full(points.shape[1], np.inf)
        for placed in self.shapes:
            outline = _outline_on_floor(placed, self.floor_height, self.robot_height)
            if outline is not None:
                np.minimum(distance, distance_to_polygon(points, outline), out=distance)
        return distance


def _outline_on_floor(placed: PlacedShape, floor: float, ceiling: float) -> NDArray[np.float64] | None:
    """The convex outline of a shape seen from above, (N, 2) counter-clockwise; None if a robot never meets it."""
    shape = placed.shape
    if isinstance(shape, Box):
        half = np.array(shape.size) / 2
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    elif isinstance(shape, Cylinder):
        turn = np.arange(16) * (2 * math.pi / 16)
        # The corners lie outside the circle, so that the sides touch it.
        ring = shape.radius / math.cos(math.pi / 16) * np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.vstack([np.column_stack([ring, np.full(16, z)]) for z in (-shape.length / 2, shape.length / 2)])
    elif isinstance(shape, Sphere):
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape.radius
    elif isinstance(shape, Mesh):
        points = shape.vertices
    points = placed.pose.apply(points)
    if points[:, 2].max() < floor or points[:, 2].min() > ceiling:
        return None
    hull: NDArray[np.float64] = points[ConvexHull(points[:, :2]).vertices, :2]
    return hull
