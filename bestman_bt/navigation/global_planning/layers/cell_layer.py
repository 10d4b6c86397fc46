"""Cells of an occupancy grid, such as SLAM makes: the occupied ones, and those that nobody has seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.occupancy_grid import OCCUPIED, UNKNOWN
from bestman_bt.navigation.global_planning.layers.base import CostmapLayer


@dataclass(frozen=True, eq=False)
class CellLayer(CostmapLayer):
    """The ``blocked`` cells (rows, columns) of a grid; each fills its square, so distances are from its border."""

    grid: OccupancyGrid
    blocked: NDArray[np.bool_]

    @classmethod
    def occupied(cls, grid: OccupancyGrid) -> CellLayer:
        """Cells from ``OCCUPIED`` / 2 on."""
        return cls(grid, grid.data >= OCCUPIED / 2)

    @classmethod
    def unknown(cls, grid: OccupancyGrid) -> CellLayer:
        """Cells that nobody has seen."""
        return cls(grid, grid.data == UNKNOWN)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See the base class; that of the cells in which the points lie, and infinite beyond the grid."""
        blocked = self.blocked
        outside = ndimage.distance_transform_edt(~blocked) if blocked.any() else np.full(blocked.shape, np.inf)
        inside = ndimage.distance_transform_edt(blocked) if not blocked.all() else np.full(blocked.shape, np.inf)
        cells = np.where(blocked, 0.5 - inside, outside - 0.5) * self.grid.resolution
        column, row = np.floor((points - self.grid.origin[:, None]) / self.grid.resolution).astype(np.intp)
        rows, columns = blocked.shape
        on_grid = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        distance = np.full(points.shape[1], np.inf)
        distance[on_grid] = cells[row[on_grid], column[on_grid]]
        return distance
