"""Cost-to-go: nav2's map grid as a distance along free floor.

A wave on a coarse grid starts at the farthest free point of the visible path before it turns back, and runs around
obstacles on the path. Descending the field thus also avoids obstacles unknown to the path, and follows a path that
comes back near itself strand by strand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """A local distance field. ``values``: (N, N) float32, metres from each cell's centre to the nearest obstacle, row 0
    at the smallest y.

    ``origin``: (x, y) metres in the map frame, the outer corner of cell (0, 0). ``resolution``: metres per cell.
    ``tall``: the same for obstacles that reach the overhang, if any.
    """

    values: NDArray[np.float32]
    origin: tuple[float, float]
    resolution: float
    tall: DistanceGrid | None = None

    def at(self, x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the values, metres, at map points, metres, arrays of any shape; outside the grid, those of its
        border.
        """
        size = self.values.shape[0]
        scale = np.float32(1.0 / self.resolution)
        column = ((x - np.float32(self.origin[0])) * scale).astype(np.int32)
        row = ((y - np.float32(self.origin[1])) * scale).astype(np.int32)
        np.clip(column, 0, size - 1, out=column)
        np.clip(row, 0, size - 1, out=row)
        row *= size
        row += column
        values: NDArray[np.float32] = self.values.ravel().take(row)
        return values


COARSE = 4
"""Number of cells of the distance grid along one coarse cell."""
_ALWAYS = 0.6
_DETOUR = 1.15
"""Length of the path ahead that is always considered, metres; beyond it, the largest ratio of path length to
straight-line distance: driving straight to a point beyond would skip a part of the path.
"""
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)
_SQUARE = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class CostToGo:
    """A cost-to-go field. ``field``: metres to the goal; ``beside``: metres from the path. Both are read as a
    ``DistanceGrid``.

    ``carrot``: (2,) metres in the map frame, a point down the field from the robot. ``aim``: index of the path's point
    at which the wave started. ``reachable``: whether it reached the robot.
    """

    field: DistanceGrid
    beside: DistanceGrid
    carrot: NDArray[np.float64]
    aim: int
    reachable: bool


def cost_to_go(
    obstacles: DistanceGrid,
    clearances: Sequence[float],
    path: NDArray[np.float64],
    remaining: NDArray[np.float64],
    robot: NDArray[np.float64],
    carrot_distance: float,
) -> CostToGo:
    """Return the field for a robot at ``robot`` (2,) with the path (N, 2) ahead, ``remaining`` (N,) metres to its end.

    ``clearances``: metres of its middle from obstacles; later ones are tried if the first gives no path. If no path
    leads to the point before it turns back, the whole visible path is tried. All in the map frame.
    """
    straight = np.linalg.norm(path - path[0], axis=1)
    driven = remaining[0] - remaining
    direct = (driven <= _ALWAYS) | (driven <= _DETOUR * straight)
    before_turn = len(path) - int(direct[::-1].argmax())
    field = None
    for end in dict.fromkeys((before_turn, len(path))):
        for clearance in clearances:
            field = _field(obstacles, clearance, path, remaining, end, robot, carrot_distance)
            if field.reachable:
                return field
    assert field is not None
    return field


def _field(
    obstacles: DistanceGrid,
    clearance: float,
    path: NDArray[np.float64],
    remaining: NDArray[np.float64],
    end: int,
    robot: NDArray[np.float64],
    carrot_distance: float,
) -> CostToGo:
    """Return the field from the last free point before ``end``; from a later one where nothing farther on is free
    there.
    """
    resolution = COARSE * obstacles.resolution
    origin = np.array(obstacles.origin)
    size = obstacles.values.shape[0] // COARSE
    # A coarse cell is free if one of its fine ones is: where the lines of the grid happen to be must close no gap.
    free = obstacles.values.reshape(size, COARSE, size, COARSE).max(axis=(1, 3)) > clearance
    cells = np.floor((path - origin) / resolution).astype(int)
    inside = np.all((cells >= 1) & (cells < size - 1), axis=1)
    last = len(path) if inside.all() else max(1, int(np.argmin(inside)))
    seeds = np.flatnonzero(free[tuple(cells[:last].clip(0, size - 1).T[::-1])])
    far = seeds[remaining[0] - remaining[seeds] > _ALWAYS]
    seeds = np.concatenate([seeds[seeds < end], far[far >= end][:1] if not (far < end).any() else far[:0]])
    start = tuple(np.floor((robot - origin) / resolution).astype(int).clip(1, size - 2)[::-1])
    seed = int(seeds[-1]) if len(seeds) else last - 1
    steps = _wave(free, tuple(cells[seed].clip(0, size - 1)[::-1]), start)
    reached = steps[start[0] - 1 : start[0] + 2, start[1] - 1 : start[1] + 2] >= 0
    most = int(steps.max()) + 3
    metres = np.where(steps >= 0, steps, most).astype(np.float32) * np.float32(0.94 * resolution)
    metres += np.float32(remaining[seed])
    off_path = np.ones((size, size), dtype=np.uint8)
    off_path[tuple(cells[:last].clip(0, size - 1).T[::-1])] = 0
    beside = cv2.distanceTransform(off_path, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * np.float32(resolution)
    fine = (size * COARSE, size * COARSE)
    return CostToGo(
        DistanceGrid(_enlarged(metres, fine), obstacles.origin, obstacles.resolution),
        DistanceGrid(_enlarged(beside, fine), obstacles.origin, obstacles.resolution),
        _descend(steps, start, round(carrot_distance / resolution)) * resolution + origin,
        seed,
        bool(reached.any()),
    )


def _wave(free: NDArray[np.bool_], seed: tuple[int, ...], start: tuple[int, ...]) -> NDArray[np.int32]:
    """Return the steps from the seed to each free cell, -1 where none; ends some way past the start.

    Alternating 4- and 8-neighbourhoods make the rings octagons, which differ from circles by at most 6 %.
    """
    passable = free.astype(np.uint8)
    passable[seed] = 1
    passable[start[0] - 1 : start[0] + 2, start[1] - 1 : start[1] + 2] = 1  # the robot may stand close to something
    reached = np.zeros_like(passable)
    reached[seed] = 1
    total = np.zeros(free.shape, dtype=np.int32)
    total += reached
    count, after_start = 1, 0
    for step in range(2 * free.shape[0]):
        grown = np.asarray(cv2.dilate(reached, _SQUARE if step % 2 else _CROSS), dtype=np.uint8) & passable
        if step % 2 and np.array_equal(grown, reached):
            break
        reached = grown
        total += reached
        count += 1
        if reached[start]:
            after_start += 1
            if after_start > 20:
                break
    return np.where(total > 0, count - total, -1)


def _descend(steps: NDArray[np.int32], start: tuple[int, ...], count: int) -> NDArray[np.float64]:
    """Return the place (x, y in cells) ``count`` steps down the field."""
    cell = list(start)
    for _ in range(count):
        low = np.array(cell) - 1
        around = steps[max(0, low[0]) : low[0] + 3, max(0, low[1]) : low[1] + 3]
        values = np.where(around >= 0, around, np.iinfo(np.int32).max)
        row, column = np.unravel_index(int(np.argmin(values)), values.shape)
        following = [max(0, low[0]) + int(row), max(0, low[1]) + int(column)]
        if following == cell:
            break
        cell = following
    return np.array([cell[1] + 0.5, cell[0] + 0.5])


def _enlarged(field: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    return np.asarray(cv2.resize(field, size, interpolation=cv2.INTER_LINEAR), dtype=np.float32)
