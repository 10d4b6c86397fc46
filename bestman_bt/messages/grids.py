"""Occupancy grids in two and three dimensions, with the conventions of ROS."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose

VOXEL_UNKNOWN, VOXEL_FREE, VOXEL_OCCUPIED = 0, 1, 2


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """A voxel grid. ``states``: (X, Y, Z) uint8 of VOXEL_UNKNOWN, VOXEL_FREE, VOXEL_OCCUPIED; ``resolution``: edge of a
    voxel, metres.

    ``frame_from_grid``: the outer corner of voxel (0, 0, 0); the axes run along the grid. ``stamp``: time of the latest
    view, seconds.
    """

    states: NDArray[np.uint8]
    resolution: float
    frame_from_grid: Pose
    stamp: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", frozen_array(self.states, (None, None, None), "VoxelGrid states", np.uint8))

    def centres(self, state: int) -> NDArray[np.float64]:
        """Return the centres (N, 3) of all voxels in ``state``, metres, in the frame of ``frame_from_grid``."""
        indices = np.argwhere(self.states == state)
        return self.frame_from_grid.apply((indices + 0.5) * self.resolution)

    def state_at(self, points: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the states (N,) at points (N, 3) of the frame, metres; VOXEL_UNKNOWN outside the grid."""
        indices = np.floor(self.frame_from_grid.inverse().apply(points) / self.resolution).astype(np.intp)
        inside = ((indices >= 0) & (indices < self.states.shape)).all(axis=1)
        states = np.full(len(points), VOXEL_UNKNOWN, dtype=np.uint8)
        states[inside] = self.states[tuple(indices[inside].T)]
        return states

    def with_unknown_from(self, other: VoxelGrid) -> VoxelGrid:
        """Return this grid with its unknown voxels filled from ``other``, a grid in the same frame."""
        states = np.array(self.states)
        unknown = np.argwhere(states == VOXEL_UNKNOWN)
        centres = self.frame_from_grid.apply((unknown + 0.5) * self.resolution)
        states[tuple(unknown.T)] = other.state_at(centres)
        return replace(self, states=states)


FREE, OCCUPIED, UNKNOWN = 0, 100, -1


def cell_centres(cells: ArrayLike, resolution: float, origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the map points (..., 2), metres, at the centres of cells (row, column) (..., 2) of a grid."""
    centres: NDArray[np.float64] = (np.asarray(cells, dtype=float)[..., ::-1] + 0.5) * resolution
    return centres + origin


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A 2D occupancy grid. ``data``: (rows, columns) int8, 0 free, 100 occupied, -1 unknown; row 0 is at the smallest
    y.

    ``resolution``: metres per cell. ``origin``: (2,) metres in the map frame, the outer corner of cell (0, 0).
    """

    data: NDArray[np.int8]
    resolution: float
    origin: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", frozen_array(self.data, (None, None), "OccupancyGrid data", np.int8))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "OccupancyGrid origin"))

    def to_cells(self, points: ArrayLike) -> NDArray[np.intp]:
        """Return the cells (row, column) (..., 2) of map points (..., 2), metres; they may lie outside the grid."""
        xy = (np.asarray(points, dtype=float) - self.origin) / self.resolution
        return np.floor(xy[..., ::-1]).astype(np.intp)

    def to_points(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Return the map points (..., 2), metres, at the centres of cells (row, column) (..., 2)."""
        return cell_centres(cells, self.resolution, self.origin)

    def contains(self, cells: ArrayLike) -> NDArray[np.bool_]:
        """Return which of the cells (row, column) (..., 2) lie inside the grid, (...) bool."""
        cells = np.asarray(cells)
        inside: NDArray[np.bool_] = np.all((cells >= 0) & (cells < self.data.shape), axis=-1)
        return inside
