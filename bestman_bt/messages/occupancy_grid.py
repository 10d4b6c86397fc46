"""Occupancy grids, as in ROS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages.frozen_array import frozen_array

FREE, OCCUPIED, UNKNOWN = 0, 100, -1


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """``data``: (rows, columns) int8, 0 free, 100 occupied, -1 unknown; row 0 is at the smallest y.

    ``resolution``: metres per cell. ``origin``: (2,) metres in the map frame, the outer corner of cell (0, 0).
    """

    data: NDArray[np.int8]
    resolution: float
    origin: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", frozen_array(self.data, (None, None), "OccupancyGrid data", np.int8))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "OccupancyGrid origin"))

    def to_cells(self, points: ArrayLike) -> NDArray[np.intp]:
        """Cells (row, column) of map points (..., 2); they may lie outside the grid."""
        xy = (np.asarray(points, dtype=float) - self.origin) / self.resolution
        return np.floor(xy[..., ::-1]).astype(np.intp)

    def to_points(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Map points (..., 2), metres, at the centres of cells (row, column)."""
        centres: NDArray[np.float64] = (np.asarray(cells, dtype=float)[..., ::-1] + 0.5) * self.resolution
        return centres + self.origin

    def contains(self, cells: ArrayLike) -> NDArray[np.bool_]:
        """Which cells (..., 2) lie inside the grid."""
        cells = np.asarray(cells)
        inside: NDArray[np.bool_] = np.all((cells >= 0) & (cells < self.data.shape), axis=-1)
        return inside
