"""The furniture of the map, wherever within its errors it may stand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.global_planning.layers.base import CostmapLayer
from bestman_bt.navigation.global_planning.layers.plane_distance import distance_to_polygon
from bestman_bt.world_model import MapFurniture


@dataclass(frozen=True, eq=False)
class FurnitureLayer(CostmapLayer):
    """Outlines of ``pieces``, turned and grown by how far these may be off.

    ``position_error``: metres, each way, and ``heading_error``: radians, unless a piece is known better.
    """

    pieces: Sequence[MapFurniture]
    position_error: float
    heading_error: float

    def reaching(self, height: float) -> FurnitureLayer:
        """The pieces that are so high."""
        high = [piece for piece in self.pieces if piece.height >= height]
        return self if len(high) == len(self.pieces) else replace(self, pieces=high)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See the base class."""
        distance = np.full(points.shape[1], np.inf)
        for piece in self.pieces:
            position_error = min(self.position_error, piece.position_error)
            for outline in _possible_outlines(piece, min(self.heading_error, piece.heading_error)):
                np.minimum(distance, distance_to_polygon(points, outline) - position_error, out=distance)
        return distance


def _possible_outlines(piece: MapFurniture, heading_error: float) -> Iterator[NDArray[np.float64]]:
    centre = piece.pose.xy
    corners = piece.corners() - centre
    for turn in (-heading_error, 0.0, heading_error) if heading_error else (0.0,):
        yield Pose2D(centre[0], centre[1], turn).apply(corners)
