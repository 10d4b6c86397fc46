"""Obstacles invisible to a planar lidar: table tops, seats, low objects, mapped from depth images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.grids import OCCUPIED
from bestman_bt.messages.shapes import NonNegative, NonNegativeInt, NotBelow, Positive


@dataclass(eq=False)
class Overhangs:
    """Stores cells of one ``resolution``, metres; nothing is removed, because overhangs are furniture.

    Metres: points between ``low`` and ``high`` above the floor count, up to ``range`` from the camera. ``min_points``:
    of one image in a cell. Cells beside those that the lidar knows as occupied are not added.
    """

    resolution: float
    low: NonNegative = 0.10
    high: Annotated[Positive, NotBelow("low")] = 1.6
    range: Positive = 3.0
    min_points: NonNegativeInt = 3

    def __post_init__(self) -> None:
        self._cells = np.zeros(0, dtype=np.int64)

    def add(self, points: NDArray[np.float64], camera: NDArray[np.float64]) -> None:
        """Store points (N, 3) of one image, taken from ``camera`` (3,), metres in the map frame."""
        near = ((points - camera) ** 2).sum(axis=1) < self.range**2
        points = points[near & (points[:, 2] > self.low) & (points[:, 2] < self.high)]
        column, row = np.floor(points[:, :2] / self.resolution).astype(np.int64).T
        # One number for each cell: sorting these is many times faster than sorting pairs.
        cells, counts = np.unique((row << 32) + column, return_counts=True)
        self._cells = np.union1d(self._cells, cells[counts >= self.min_points])

    def drawn_on(self, grid: OccupancyGrid) -> OccupancyGrid:
        """Return the grid with these cells occupied, for planning."""
        row = (self._cells + (1 << 31)) >> 32
        column = self._cells - (row << 32)
        cells = grid.to_cells((np.column_stack([column, row]) + 0.5) * self.resolution)
        cells = cells[grid.contains(cells)]
        over = np.zeros(grid.data.shape, dtype=bool)
        over[tuple(cells.T)] = True
        over &= ~ndimage.binary_dilation(grid.data == OCCUPIED, np.ones((3, 3)))
        return OccupancyGrid(np.where(over, OCCUPIED, grid.data).astype(np.int8), grid.resolution, grid.origin)
