"""Random places at which a base can turn: what planners that sample draw from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.navigation.global_planning.room import Room

_NEAR = 0.3
"""Metres beyond the distance at which the base can turn that count as near an obstacle."""


def turning_places(room: Room, count: int, near_obstacles: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Up to ``count`` points (N, 2), metres; a share of ``near_obstacles`` is drawn near these.

    In doorways samples are rare otherwise (Boor, Overmars and van der Stappen, "The Gaussian sampling strategy for
    probabilistic roadmap planners", ICRA 1999).
    """
    costmap = room.costmap.for_turning
    beyond = costmap.distance - room.turning_distance
    near = round(near_obstacles * count)
    drawn = []
    for free, wanted in ((beyond >= 0.0, count - near), ((beyond >= -room.slack) & (beyond < _NEAR), near)):
        cells = np.argwhere(free)
        if len(cells):
            drawn.append(costmap.grid_points(cells[rng.integers(len(cells), size=wanted)]))
    if not drawn:
        return np.zeros((0, 2))
    points = np.vstack(drawn)
    points += rng.uniform(-0.5, 0.5, points.shape) * costmap.resolution
    places: NDArray[np.float64] = rng.permutation(points[room.can_turn(points)])
    return places
