from __future__ import annotations

import numpy as np

from bestman_bt.messages import Pose, VoxelGrid
from bestman_bt.messages.voxel_grid import VOXEL_FREE, VOXEL_OCCUPIED
from bestman_bt.scene import draw_world, load_scene, semantic_map
from bestman_bt.world_model import WorldModel

DRAWER = "drawer_chest/drawer_3"


def test_what_was_seen_of_an_open_drawer_is_not_there_any_more_when_it_was_shut() -> None:
    world = WorldModel(semantic_map(draw_world(load_scene("chest_room", {}), 0)))
    world.believe_articulation(DRAWER, 0.3)
    piece, surface = world.surface(DRAWER)
    middle = (piece.pose.to_pose() @ surface.pose).position
    seen = np.full((60, 60, 60), VOXEL_OCCUPIED, dtype=np.uint8)
    world.occupancy = VoxelGrid(seen, 0.05, Pose(middle - 1.5), 1.0)
    far = middle + np.array([-1.0, 0.0, 0.0])
    world.believe_articulation(DRAWER, 0.295)
    assert world.occupancy.state_at(np.array([middle, far])).tolist() == [VOXEL_OCCUPIED, VOXEL_OCCUPIED]
    world.believe_articulation(DRAWER, 0.0)
    assert world.occupancy.state_at(np.array([middle, far])).tolist() == [VOXEL_FREE, VOXEL_OCCUPIED]
