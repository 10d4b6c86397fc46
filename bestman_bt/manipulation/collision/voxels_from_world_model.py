"""What has been seen to fill space, and that nothing believed explains: as voxels for the collision world."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from bestman_bt.manipulation.collision.planning_scene import VoxelObstacle
from bestman_bt.messages import VOXEL_OCCUPIED, VOXEL_UNKNOWN, PlacedShape, Pose, VoxelGrid, distance_to_shape

OCCUPIED, UNKNOWN = "occupied", "unknown"


def voxel_obstacles(
    grid: VoxelGrid,
    base_from_map: Pose,
    explained: Iterable[PlacedShape],
    *,
    slack: float,
    reach: float,
    unknown: bool,
) -> tuple[VoxelObstacle, ...]:
    """Obstacles ``occupied`` and, where ``unknown``, ``unknown``, of the voxels within ``reach`` metres of the base.

    ``explained``: shapes in the base frame; a voxel that touches one, or comes within ``slack`` metres, is left out.
    """
    base_from_grid = base_from_map @ grid.frame_from_grid
    shapes = tuple(explained)
    obstacles = []
    for name, state in ((OCCUPIED, VOXEL_OCCUPIED), (UNKNOWN, VOXEL_UNKNOWN)):
        if state == VOXEL_UNKNOWN and not unknown:
            continue
        indices = np.argwhere(grid.states == state)
        centres = base_from_grid.apply((indices + 0.5) * grid.resolution)
        wanted = np.hypot(centres[:, 0], centres[:, 1]) < reach
        indices, centres = indices[wanted], centres[wanted]
        for placed in shapes:
            left = distance_to_shape(centres, placed) > slack + math.sqrt(3.0) / 2 * grid.resolution
            indices, centres = indices[left], centres[left]
        if len(indices):
            obstacles.append(VoxelObstacle(name, base_from_grid, indices, grid.resolution))
    return tuple(obstacles)
