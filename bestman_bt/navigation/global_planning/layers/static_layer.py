"""The walls of the map, which are exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.navigation.global_planning.layers.base import CostmapLayer
from bestman_bt.navigation.global_planning.layers.plane_distance import squared_distance_to_segment


@dataclass(frozen=True, eq=False)
class StaticLayer(CostmapLayer):
    """``walls``: (N, 4) segments x1, y1, x2, y2 in metres."""

    walls: NDArray[np.float64]

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See the base class; walls have no inside."""
        squared = np.full(points.shape[1], np.inf)
        for segment in self.walls:
            np.minimum(squared, squared_distance_to_segment(points, segment[:2], segment[2:]), out=squared)
        distance: NDArray[np.float64] = np.sqrt(squared)
        return distance
