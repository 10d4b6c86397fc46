"""Obstacles that the lidar sees and the map lacks: a rolling grid, marked by hits and cleared by rays.

Like nav2's obstacle layer. Hits on obstacles of the costmap belong to the costmap, which is more accurate. Moving
obstacles are tracked separately, see ``MovingObstacles``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.messages.shapes import Count, NonNegative, Positive
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.cost_to_go import DistanceGrid
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacles

INFLUENCE = 1.0
"""Distance within which a marked obstacle changes the costs of a costmap, metres."""


@dataclass(eq=False)
class ObstacleLayer:
    """Processes scans; ``points``: static obstacles that the costmap lacks, (N, 2) middles of cells, map frame, metres.

    ``size``: side of the square, metres. ``resolution``: metres per cell. ``roll``: metres per shift. ``range``: metres
    from the lidar within which hits mark cells. ``known``: metres from an obstacle of the costmap within which hits
    belong to it. ``evidence``: scans that must see through a cell to clear it. ``ray_margin``: metres before a hit that
    its beam does not clear.
    """

    size: Annotated[Positive, "m"] = 16.0
    resolution: Annotated[Positive, "m per cell"] = 0.025
    roll: Annotated[Positive, "m"] = 0.5
    range: Annotated[Positive, "m"] = 5.0
    known: Annotated[NonNegative, "m"] = 0.06
    evidence: Count = 3
    ray_margin: Annotated[NonNegative, "m"] = 0.05
    moving: MovingObstacles = field(default_factory=MovingObstacles)

    def __post_init__(self) -> None:
        self._cells = round(self.size / self.resolution)
        self._evidence: NDArray[np.int8] = np.zeros((self._cells, self._cells), dtype=np.int8)
        self._steps: tuple[int, int] | None = None  # of ``roll``, from the map's origin to the square's
        self._costmap: Costmap | None = None
        self.points: NDArray[np.float64] = np.zeros((0, 2))

    @property
    def origin(self) -> tuple[float, float] | None:
        """Metres in the map frame, the outer corner of cell (0, 0), or None before the first scan."""
        return None if self._steps is None else (self._steps[0] * self.roll, self._steps[1] * self.roll)

    @property
    def marked(self) -> NDArray[np.bool_]:
        """Return the occupied cells, (N, N) bool, row 0 at the smallest y."""
        return self._evidence > 0

    def use_costmap(self, costmap: Costmap | None) -> None:
        """Set the known obstacles; marks that they explain are removed."""
        self._costmap = costmap
        if costmap is not None:
            self._drop(self.points[costmap.distance_at(self.points) <= self.known])

    def clear(self, which: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None) -> None:
        """Remove marks, ``which``: mask (N,) of points (N, 2), or all; existing obstacles are marked again by the next
        scan.
        """
        self._drop(self.points if which is None else self.points[which(self.points)])

    def centre_on(self, pose: Pose2D) -> None:
        """Shift the square so that it lies around ``pose``."""
        wanted = (round((pose.x - self.size / 2) / self.roll), round((pose.y - self.size / 2) / self.roll))
        if wanted == self._steps:
            return
        if self._steps is not None:
            step = round(self.roll / self.resolution)
            columns, rows = ((w - o) * step for w, o in zip(wanted, self._steps, strict=True))
            self._evidence = _shifted(self._evidence, rows, columns)
        self._steps = wanted
        self._collect()

    def update(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Process a scan and its pose."""
        self.centre_on(map_from_lidar)
        self._clear_by_rays(scan, map_from_lidar)
        hits = map_from_lidar.apply(scan.points())
        hits = hits[np.linalg.norm(hits - map_from_lidar.xy, axis=1) < self.range]
        if self._costmap is not None and len(hits):
            hits = hits[self._costmap.distance_at(hits) > self.known]
        standing = self.moving.update(hits, map_from_lidar.xy, scan.range_min, scan.stamp)
        column, row = self._to_cells(standing).T
        inside = (column >= 0) & (row >= 0) & (column < self._cells) & (row < self._cells)
        self._evidence[row[inside], column[inside]] = self.evidence
        self._collect()

    def on(self, costmap: Costmap) -> Costmap:
        """Return the costmap with the static obstacles; the same one without any.

        Heights are unknown to a lidar. Most such obstacles are chairs and boxes, lower than an arm: they are checked
        against the base, but not against its overhang.
        """
        column, row = np.floor((self.points - costmap.origin) / costmap.resolution).astype(np.intp).T
        rows, columns = costmap.distance.shape
        inside = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        if not inside.any():
            return costmap
        points, row, column = self.points[inside], row[inside], column[inside]
        reach = math.ceil(INFLUENCE / costmap.resolution)
        top, left = max(0, int(row.min()) - reach), max(0, int(column.min()) - reach)
        window = np.s_[top : int(row.max()) + reach + 1, left : int(column.max()) + reach + 1]
        height, width = costmap.distance[window].shape
        taken = np.ones((height, width), dtype=np.uint8)
        taken[row - top, column - left] = 0
        _, labels = cv2.distanceTransformWithLabels(taken, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL)
        # Which cell with a mark is the nearest one tells the grid; how far its marks are, their middle does.
        at = labels[row - top, column - left]
        count = np.bincount(at, minlength=int(labels.max()) + 1)
        sums = np.column_stack([np.bincount(at, points[:, axis], len(count)) for axis in (0, 1)])
        middles = sums / np.maximum(count, 1)[:, None]
        y, x = np.mgrid[top : top + height, left : left + width]
        nearest = middles[labels]
        away = np.hypot(
            costmap.origin[0] + (x + 0.5) * costmap.resolution - nearest[..., 0],
            costmap.origin[1] + (y + 0.5) * costmap.resolution - nearest[..., 1],
        )
        margin = self.resolution / 2 + costmap.rasterization.clearance
        distance = np.array(costmap.distance)
        distance[window] = np.minimum(distance[window], away - margin)
        return replace(costmap, distance=distance)

    def _clear_by_rays(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Lower the belief in obstacles in cells that a beam passes through."""
        marked = np.flatnonzero(self.marked)
        if not len(marked):
            return
        row, column = np.divmod(marked, self._cells)
        assert self.origin is not None
        x = self.origin[0] + (column + 0.5) * self.resolution - map_from_lidar.x
        y = self.origin[1] + (row + 0.5) * self.resolution - map_from_lidar.y
        distance = np.hypot(x, y)
        bearing = np.arctan2(y, x) - map_from_lidar.theta - scan.angle_min
        beam = np.round(bearing % (2.0 * math.pi) / scan.angle_increment).astype(int)
        if round(2.0 * math.pi / scan.angle_increment) == len(scan.ranges):
            beam %= len(scan.ranges)
        covered = beam < len(scan.ranges)
        measured = np.minimum(scan.ranges, scan.range_max)[np.where(covered, beam, 0)]
        seen_through = covered & (distance < measured - self.ray_margin) & (distance > scan.range_min)
        self._evidence.flat[marked[seen_through]] -= 1

    def _drop(self, points: NDArray[np.float64]) -> None:
        if len(points):
            column, row = self._to_cells(points).T
            self._evidence[row, column] = 0
            self._collect()

    def _to_cells(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        assert self.origin is not None
        cells: NDArray[np.intp] = np.floor((points - np.array(self.origin)) / self.resolution).astype(np.intp)
        return cells

    def _collect(self) -> None:
        assert self.origin is not None or not self._evidence.any()
        row, column = np.divmod(np.flatnonzero(self.marked), self._cells)
        resolution = self.resolution
        self.points = np.column_stack([column, row]) * resolution + np.array(self.origin or (0.0, 0.0)) + resolution / 2


def _shifted(grid: NDArray[np.int8], rows: int, columns: int) -> NDArray[np.int8]:
    """Return the same cells seen from an origin that lies ``rows`` and ``columns`` further; what was not in view is
    zero.
    """
    shifted = np.zeros_like(grid)
    size = grid.shape[0]
    if abs(rows) < size and abs(columns) < size:
        to_row, to_column = (slice(max(0, -n), size - max(0, n)) for n in (rows, columns))
        from_row, from_column = (slice(max(0, n), size - max(0, -n)) for n in (rows, columns))
        shifted[to_row, to_column] = grid[from_row, from_column]
    return shifted


# What stands around the robot, known or seen, as a square of distances that rolls along.
# As nav2's local costmap: that of the map and an ``ObstacleLayer``, measured by the exact Euclidean distance transform.


FAR = 10.0


@dataclass(eq=False)
class LocalObstacles(ObstacleLayer):
    """A layer of 6 m; ``distance``: to all obstacles around, known or seen."""

    size: Annotated[Positive, "m"] = 6.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._mapped: NDArray[np.float32] = np.full((self._cells, self._cells), FAR, dtype=np.float32)
        self._tall: NDArray[np.float32] | None = None
        self.distance = DistanceGrid(self._mapped, (0.0, 0.0), self.resolution)

    def use_costmap(self, costmap: Costmap | None) -> None:
        """Set the costmap whose obstacles are not marked again."""
        super().use_costmap(costmap)
        if self.origin is not None:
            self._rasterise_map(self.origin)
            self._measure()

    @override
    def centre_on(self, pose: Pose2D) -> None:
        before = self.origin
        super().centre_on(pose)
        if self.origin is not None and self.origin != before:
            self._rasterise_map(self.origin)
            self._measure()

    @override
    def update(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        super().update(scan, map_from_lidar)
        self._measure()

    def _rasterise_map(self, origin: tuple[float, float]) -> None:
        if self._costmap is None:
            self._mapped, self._tall = np.full_like(self._mapped, FAR), None
            return
        along = (np.arange(self._mapped.shape[0]) + 0.5) * self.resolution
        x, y = np.meshgrid(origin[0] + along, origin[1] + along)
        middles, above = np.stack([x, y], axis=-1), self._costmap.above
        self._mapped = self._costmap.distance_at(middles).astype(np.float32)
        self._tall = None if above is None else above.distance_at(middles).astype(np.float32)

    def _measure(self) -> None:
        origin, marked = self.origin, self.marked
        assert origin is not None
        distance, tall = self._mapped, self._tall
        if marked.any():
            cells = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            distance = np.minimum(distance, (cells - np.float32(0.5)) * np.float32(self.resolution))
        above = None if tall is None else DistanceGrid(tall, origin, self.resolution)
        self.distance = DistanceGrid(distance, origin, self.resolution, above)
