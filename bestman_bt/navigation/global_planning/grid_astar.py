"""A* on the grid (Hart, Nilsson and Raphael 1968), 8-connected, with cost, then any-angle smoothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.navigation.global_planning.grid_search import cheapest_way
from bestman_bt.navigation.global_planning.polyline_planner import PolylinePlanner
from bestman_bt.navigation.global_planning.room import Room


@dataclass(frozen=True)
class GridAStar(PolylinePlanner):
    """The cheapest way over the cells; deterministic."""

    def way(self, start: NDArray[np.float64], goal: NDArray[np.float64], room: Room) -> NDArray[np.float64] | None:
        """See the base class."""
        return cheapest_way(start, goal, room.field, room.lethal_distance, room.lethal_slack)
