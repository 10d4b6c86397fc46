"""Voxels for coal: an octree, and which voxels the robot itself disproves.

Hornung et al., "OctoMap: an efficient probabilistic 3D mapping framework based on octrees", Autonomous Robots 2013.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import coal
import numpy as np
import pinocchio

from bestman_bt.manipulation.collision.planning_scene import VoxelObstacle

Placed: TypeAlias = tuple[coal.CollisionGeometry, pinocchio.SE3]
"""A geometry and its pose in the frame of its body."""


def octree(voxels: VoxelObstacle) -> coal.OcTree:
    """The voxels in the frame of their grid."""
    return coal.makeOctree((voxels.indices + 0.5) * voxels.resolution, voxels.resolution)


def clear_of(voxels: VoxelObstacle, bodies: Sequence[Placed], margin: float) -> VoxelObstacle:
    """The voxels that do not touch the bounding box of any body, grown by ``margin`` metres.

    Where the robot is now is no obstacle, whatever was seen there. ``bodies``: geometries and their poses in the base.
    """
    reach = margin + math.sqrt(3.0) / 2 * voxels.resolution
    indices = voxels.indices
    centres = voxels.base_from_grid.apply((indices + 0.5) * voxels.resolution)
    for geometry, base_from_body in bodies:
        geometry.computeLocalAABB()
        box = geometry.aabb_local
        local = (centres - base_from_body.translation) @ base_from_body.rotation
        outside = ((local < box.min_ - reach) | (local > box.max_ + reach)).any(axis=1)
        indices, centres = indices[outside], centres[outside]
    return replace(voxels, indices=np.ascontiguousarray(indices))
