"""What a planar lidar does not see: table tops, seats, things below its plane, drawn from depth images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.occupancy_grid import OCCUPIED


@dataclass(frozen=True)
class OverhangsParameters:
    """Metres: points between ``low`` and ``high`` above the floor count, no farther than ``range`` from the camera.

    ``min_points``: of one image in a cell. Beside cells that the lidar knows as occupied, nothing is added: there it
    knows better.
    """

    low: float = 0.10
    high: float = 1.6
    range: float = 3.0
    min_points: int = 3


class Overhangs:
    """Remembers cells of one resolution, metres; nothing is forgotten, for what hangs over the floor is furniture."""

    def __init__(self, resolution: float, parameters: OverhangsParameters | None = None) -> None:
        self._parameters = parameters or OverhangsParameters()
        self._resolution = resolution
        self._cells = np.zeros((0, 2), dtype=np.intp)

    def add(self, points: NDArray[np.float64], camera: NDArray[np.float64]) -> None:
        """Remember points (N, 3) of one image, taken from ``camera`` (3,), metres in the map frame."""
        p = self._parameters
        near = np.linalg.norm(points - camera, axis=1) < p.range
        points = points[near & (points[:, 2] > p.low) & (points[:, 2] < p.high)]
        cells, counts = np.unique(
            np.floor(points[:, :2] / self._resolution).astype(np.intp), axis=0, return_counts=True
        )
        self._cells = np.unique(np.vstack([self._cells, cells[counts >= p.min_points]]), axis=0)

    def drawn_on(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The grid with these cells occupied, for planning."""
        cells = grid.to_cells((self._cells + 0.5) * self._resolution)
        cells = cells[grid.contains(cells)]
        over = np.zeros(grid.data.shape, dtype=bool)
        over[tuple(cells.T)] = True
        over &= ~ndimage.binary_dilation(grid.data == OCCUPIED, np.ones((3, 3)))
        return OccupancyGrid(np.where(over, OCCUPIED, grid.data).astype(np.int8), grid.resolution, grid.origin)
