"""Drawing of people and their routes: loops over points of the free floor, on shortest paths."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from bestman_bt.messages import Pose2D
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.plane_geometry import Points
from bestman_bt.scene.scene_config import WalkersConfig
from bestman_bt.scene.walker import Walker

_STEP = 4  # cells of the floor's grid
_ROOM = 0.06  # metres beside a walker
_FROM_ROBOT = 1.2  # metres between the middles of robot and walker at the start
_FROM_EACH_OTHER = 0.8
_KEEP_AWAY = (2.0, 0.2)  # cost beside obstacles, metres within which it fades: people walk in the middle of doorways
_TRIES = 200


def draw_walkers(
    asked: WalkersConfig, outlines: Sequence[Points], robot: Pose2D, generator: Callable[[str], np.random.Generator]
) -> tuple[Walker, ...] | None:
    """Return ``asked.count`` walkers on the floor between ``outlines``, or None without enough room.

    ``robot``: start pose. ``generator``: random numbers by the walker's name.
    """
    floor = FloorGrid.of(outlines).every(_STEP)
    walkers: list[Walker] = []
    for number in range(1, asked.count + 1):
        name = f"walker_{number}"
        rng = generator(name)
        radius, speed = float(rng.uniform(*asked.radius)), float(rng.uniform(*asked.speed))
        free = floor.largest_area(radius + _ROOM)
        points = _way_points(asked, floor, free, robot, walkers, rng)
        route = _round(floor, free, points) if points is not None else None
        if route is None:
            return None
        walkers.append(Walker(name, radius, asked.height, asked.mass, speed, route, asked.considerate))
    return tuple(walkers)


def _way_points(
    asked: WalkersConfig,
    floor: FloorGrid,
    free: NDArray[np.bool_],
    robot: Pose2D,
    others: Sequence[Walker],
    rng: np.random.Generator,
) -> Points | None:
    """Points (N, 2) to walk between; the first one is not near the robot nor near another walker."""
    if asked.way_points is not None:
        return np.array(asked.way_points)
    rows, columns = np.nonzero(free)
    for _ in range(_TRIES if len(rows) else 0):
        chosen = rng.integers(len(rows), size=asked.stops)
        points = floor.points(rows[chosen], columns[chosen])
        near = [math.dist(points[0], other.route[0]) < _FROM_EACH_OTHER for other in others]
        if math.dist(points[0], robot.xy) >= _FROM_ROBOT and not any(near):
            return points
    return None


def _round(floor: FloorGrid, free: NDArray[np.bool_], points: Points) -> tuple[tuple[float, float], ...] | None:
    """Return the shortest ways from each of ``points`` to the next one and back to the first, or None if one is cut
    off.
    """
    rows, columns = floor.cells(points)
    numbers = np.full(free.shape, -1)
    numbers[free] = np.arange(int(free.sum()))
    stops = numbers[rows, columns]
    if np.any(stops < 0):
        return None
    lengths, before = dijkstra(_steps(floor, numbers), directed=False, indices=stops, return_predecessors=True)
    cells = np.argwhere(free)
    route: list[tuple[float, float]] = []
    for index, stop in enumerate(np.roll(stops, -1)):
        if not np.isfinite(lengths[index, stop]):
            return None
        way = [int(stop)]
        while way[-1] != stops[index]:
            way.append(int(before[index, way[-1]]))
        route += [(float(x), float(y)) for x, y in floor.points(*cells[way[:0:-1]].T)]
    return tuple(route) or None


def _steps(floor: FloorGrid, numbers: NDArray[np.intp]) -> coo_array:
    """Return the graph of the free cells, each with its eight neighbours; weights are lengths, greater beside
    obstacles.
    """
    most, fades = _KEEP_AWAY
    cost = 1.0 + most * np.exp(-floor.room / fades)
    rows, columns = numbers.shape
    starts, ends, weights = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
        there = (slice(down, rows), slice(max(0, right), columns + min(0, right)))
        both = (numbers[here] >= 0) & (numbers[there] >= 0)
        starts.append(numbers[here][both])
        ends.append(numbers[there][both])
        weights.append(math.hypot(down, right) * floor.resolution * (cost[here] + cost[there])[both] / 2)
    count = int(numbers.max()) + 1
    return coo_array((np.concatenate(weights), (np.concatenate(starts), np.concatenate(ends))), shape=(count, count))
