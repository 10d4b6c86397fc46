"""Space that is known to be free for another reason than having been seen through."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bestman_bt.messages import VOXEL_FREE, VOXEL_OCCUPIED, PlacedShape, VoxelGrid, distance_to_shape


def freed(grid: VoxelGrid, shapes: Iterable[PlacedShape], slack: float = 0.015) -> VoxelGrid:
    """The grid after the bodies with these shapes (in its frame) have been taken away, for example by the hand.

    Occupied voxels that touch a shape, or come within ``slack`` metres of one, become free.
    """
    states = np.array(grid.states)
    for placed in shapes:
        indices = np.argwhere(states == VOXEL_OCCUPIED)
        centres = grid.frame_from_grid.apply((indices + 0.5) * grid.resolution)
        near = distance_to_shape(centres, placed) <= slack + math.sqrt(3.0) / 2 * grid.resolution
        states[tuple(indices[near].T)] = VOXEL_FREE
    return replace(grid, states=states)
