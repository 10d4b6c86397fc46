"""An occupancy grid that scans are drawn into, by log odds (H. Moravec, A. Elfes 1985; S. Thrun et al. 2005, ch. 9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, OccupancyGrid, Pose2D
from bestman_bt.messages.bounds import NonNegative, NotBelow, Positive, check_bounds
from bestman_bt.messages.occupancy_grid import FREE, OCCUPIED, UNKNOWN

GROWTH = 16
"""Cells by which the grid grows at a time."""


@dataclass(eq=False)
class LogOddsGrid:
    """Grows as needed. Each scan counts once for a cell, as a hit where it is both hit and passed.

    ``resolution``: metres per cell. ``hit``, ``miss``: log odds that a scan adds to a cell that it hits or passes.

    ``limit``: they never exceed it, each way, so that what has changed is believed after a while. A cell is occupied
    from ``occupied`` on (one hit), free from ``-free`` on (one pass). ``keep``: metres before a hit that a beam does
    not clear: its noise, and a grazed wall. ``border``: metres of unknown that are kept around all that was seen, for
    there is something beyond it, to look for and not to drive into.
    """

    resolution: Annotated[Positive, "m per cell"] = 0.05
    hit: Positive = 0.85
    miss: Positive = 0.3
    limit: Annotated[Positive, NotBelow("occupied"), NotBelow("free")] = 4.0
    occupied: Positive = 0.8
    free: Positive = 0.25
    keep: Annotated[NonNegative, "m"] = 0.06
    border: Annotated[NonNegative, "m"] = 2.0

    def __post_init__(self) -> None:
        check_bounds(self)
        self._log_odds = np.zeros((0, 0))
        self._seen = np.zeros((0, 0), dtype=bool)
        self._first = np.zeros(2, dtype=np.intp)  # column and row of cell (0, 0), counted from the map's origin

    def add(self, map_from_lidar: Pose2D, scan: LaserScan) -> None:
        """Draw a scan taken at ``map_from_lidar``.

        A beam without a hit tells nothing: it may have gone astray on glass, or on the robot itself.
        """
        hit = np.isfinite(scan.ranges)
        ranges = scan.ranges[hit]
        heading = scan.angles[hit] + map_from_lidar.theta
        directions = np.column_stack([np.cos(heading), np.sin(heading)])
        step = 0.7 * self.resolution
        along = np.arange(0.0, float(ranges.max(initial=0.0)), step)
        passed = along[None] < (ranges - self.keep)[:, None]
        beam, sample = np.nonzero(passed)
        free = self._cells(map_from_lidar.xy + along[sample, None] * directions[beam])
        ends = self._cells(map_from_lidar.xy + ranges[:, None] * directions)
        self._grow(np.concatenate([free, ends]))
        touched = np.zeros(self._log_odds.shape, dtype=np.int8)
        touched[tuple((free - self._first).T[::-1])] = 1
        touched[tuple((ends - self._first).T[::-1])] = 2
        change = np.array([0.0, -self.miss, self.hit])
        self._log_odds = np.clip(self._log_odds + change[touched], -self.limit, self.limit)
        self._seen |= touched > 0

    def grid(self) -> OccupancyGrid:
        """The cells that are believed occupied and free; the others are unknown."""
        data = np.full(self._log_odds.shape, UNKNOWN, dtype=np.int8)
        data[self._seen & (self._log_odds <= -self.free)] = FREE
        data[self._log_odds >= self.occupied] = OCCUPIED
        return OccupancyGrid(data, self.resolution, np.asarray(self._first * self.resolution, dtype=np.float64))

    def _cells(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """(N, 2) column and row from the map's origin."""
        return np.floor(points / self.resolution).astype(np.intp)

    def _grow(self, cells: NDArray[np.intp]) -> None:
        if len(cells) == 0:
            return
        border = round(self.border / self.resolution)
        low, high = cells.min(axis=0) - border, cells.max(axis=0) + 1 + border
        if self._log_odds.size:
            old_high = self._first + self._log_odds.shape[::-1]
            before = -(-np.maximum(self._first - low, 0) // GROWTH) * GROWTH
            after = -(-np.maximum(high - old_high, 0) // GROWTH) * GROWTH
        else:
            self._first = low
            before, after = np.zeros(2, dtype=np.intp), high - low
        if before.any() or after.any():
            padding = ((before[1], after[1]), (before[0], after[0]))
            self._log_odds = np.pad(self._log_odds, padding)
            self._seen = np.pad(self._seen, padding)
            self._first = self._first - before
