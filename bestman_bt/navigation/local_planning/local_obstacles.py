"""What the lidar sees around the robot and the map does not know: a rolling grid, cleared by rays.

As nav2's obstacle layer in its rolling window: hits mark cells, beams that pass through clear them, and the exact
Euclidean distance transform tells how far each place is from the next one. Hits that lie on something in the costmap
are the costmap's, which knows it better. What moves is tracked apart, see ``MovingObstacles``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.distance_grid import DistanceGrid
from bestman_bt.navigation.local_planning.moving_obstacles import (
    MovingObstacle,
    MovingObstacles,
    MovingObstaclesParameters,
)

FAR = 10.0


@dataclass(frozen=True)
class LocalObstaclesParameters:
    """``size``: metres, the side of the square. ``resolution``: metres per cell. ``roll``: metres, its steps.

    ``known``: metres; hits that near to an obstacle of the costmap are that obstacle. ``evidence``: scans that must see
    through a cell before what was in it is forgotten. ``ray_margin``: metres before a hit that its beam does not clear.
    """

    size: float = 6.0
    resolution: float = 0.025
    roll: float = 0.5
    known: float = 0.06
    evidence: int = 3
    ray_margin: float = 0.05
    moving: MovingObstaclesParameters = field(default_factory=MovingObstaclesParameters)


class LocalObstacles:
    """Takes in scans; ``distance``: to everything around, known or seen; ``points``: what the map lacks."""

    def __init__(self, parameters: LocalObstaclesParameters | None = None) -> None:
        self._parameters = p = parameters or LocalObstaclesParameters()
        self._cells = round(p.size / p.resolution)
        self._evidence: NDArray[np.int8] = np.zeros((self._cells, self._cells), dtype=np.int8)
        self._mapped: NDArray[np.float32] = np.full((self._cells, self._cells), FAR, dtype=np.float32)
        self._origin: tuple[int, int] | None = None  # in steps of ``roll``
        self._costmap: Costmap | None = None
        self._tracks = MovingObstacles(p.moving)
        self.distance = DistanceGrid(self._mapped, (0.0, 0.0), p.resolution)
        self.points: NDArray[np.float64] = np.zeros((0, 2))  # middles of cells, map frame, metres

    @property
    def moving(self) -> list[MovingObstacle]:
        """What moves, as of the last scan."""
        return self._tracks.moving

    def use_costmap(self, costmap: Costmap | None) -> None:
        """What the map knows from now on."""
        self._costmap = costmap
        if self._origin is not None:
            self._rasterise_map()
            self._measure()

    def centre_on(self, pose: Pose2D) -> None:
        """Make sure that the square lies around ``pose``."""
        p = self._parameters
        wanted = (round((pose.x - p.size / 2) / p.roll), round((pose.y - p.size / 2) / p.roll))
        if wanted == self._origin:
            return
        if self._origin is not None:
            step = round(p.roll / p.resolution)
            columns, rows = ((w - o) * step for w, o in zip(wanted, self._origin, strict=True))
            self._evidence = _shifted(self._evidence, rows, columns)
        self._origin = wanted
        self._rasterise_map()
        self._measure()

    def update(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Take in a scan and where it was taken."""
        self.centre_on(map_from_lidar)
        self._clear(scan, map_from_lidar)
        hits = map_from_lidar.apply(scan.points())
        if self._costmap is not None and len(hits):
            hits = hits[self._costmap.distance_at(hits) > self._parameters.known]
        standing = self._tracks.update(hits, map_from_lidar.xy, scan.range_min, scan.stamp)
        column, row = self._to_cells(standing).T
        inside = (column >= 0) & (row >= 0) & (column < self._cells) & (row < self._cells)
        self._evidence[row[inside], column[inside]] = self._parameters.evidence
        self._measure()

    def _clear(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Believe a cell that a beam passes through a little less in what was in it."""
        marked = np.flatnonzero(self._evidence)
        if not len(marked):
            return
        row, column = np.divmod(marked, self._cells)
        assert self._origin is not None
        p = self._parameters
        x = self._origin[0] * p.roll + (column + 0.5) * p.resolution - map_from_lidar.x
        y = self._origin[1] * p.roll + (row + 0.5) * p.resolution - map_from_lidar.y
        distance = np.hypot(x, y)
        bearing = np.arctan2(y, x) - map_from_lidar.theta - scan.angle_min
        beam = np.round(bearing % (2.0 * math.pi) / scan.angle_increment).astype(int)
        if round(2.0 * math.pi / scan.angle_increment) == len(scan.ranges):
            beam %= len(scan.ranges)
        covered = beam < len(scan.ranges)
        measured = np.minimum(scan.ranges, scan.range_max)[np.where(covered, beam, 0)]
        seen_through = covered & (distance < measured - p.ray_margin) & (distance > scan.range_min)
        self._evidence.flat[marked[seen_through]] -= 1

    def _to_cells(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        assert self._origin is not None
        p = self._parameters
        return np.floor((points - np.array(self._origin) * p.roll) / p.resolution).astype(np.intp)

    def _rasterise_map(self) -> None:
        if self._costmap is None or self._origin is None:
            self._mapped = np.full_like(self._mapped, FAR)
            return
        p = self._parameters
        along = (np.arange(self._cells) + 0.5) * p.resolution
        x, y = np.meshgrid(self._origin[0] * p.roll + along, self._origin[1] * p.roll + along)
        self._mapped = self._costmap.distance_at(np.stack([x, y], axis=-1)).astype(np.float32)

    def _measure(self) -> None:
        p = self._parameters
        assert self._origin is not None
        origin = (self._origin[0] * p.roll, self._origin[1] * p.roll)
        marked = self._evidence > 0
        row, column = np.nonzero(marked)
        self.points = np.column_stack([column, row]) * p.resolution + np.array(origin) + p.resolution / 2
        distance = self._mapped
        if len(row):
            cells = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            distance = np.minimum(distance, (cells - np.float32(0.5)) * np.float32(p.resolution))
        self.distance = DistanceGrid(distance, origin, p.resolution)


def _shifted(grid: NDArray[np.int8], rows: int, columns: int) -> NDArray[np.int8]:
    """The same cells seen from an origin that lies ``rows`` and ``columns`` further; what was not in view is zero."""
    shifted = np.zeros_like(grid)
    size = grid.shape[0]
    if abs(rows) < size and abs(columns) < size:
        to_row, to_column = (slice(max(0, -n), size - max(0, n)) for n in (rows, columns))
        from_row, from_column = (slice(max(0, n), size - max(0, -n)) for n in (rows, columns))
        shifted[to_row, to_column] = grid[from_row, from_column]
    return shifted
