"""A square of distances around the robot, for quick look-ups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """``values``: (N, N) float32, metres from each cell's centre to the next obstacle, row 0 at the smallest y.

    ``origin``: (x, y) metres in the map frame, the outer corner of cell (0, 0). ``resolution``: metres per cell.
    ``tall``: the same for what reaches up to the footprint's overhang, where it has one.
    """

    values: NDArray[np.float32]
    origin: tuple[float, float]
    resolution: float
    tall: DistanceGrid | None = None

    def at(self, x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values of the cells at map points, of any shape; beyond the square those of its edge."""
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
