from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Box, ObjectModel, PlacedShape, PointCloud, Pose, VoxelGrid, YawSet
from bestman_bt.messages.grids import VOXEL_FREE, VOXEL_OCCUPIED
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.world_model import ObjectBelief, WorldModel

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


def test_what_lies_in_a_drawer_or_is_seen_on_a_door_goes_along_with_all_that_is_known_of_it() -> None:
    box = ObjectModel("box", (1.0, 0.0, 0.0), 0.1, 0.5, (PlacedShape(Box((0.1, 0.1, 0.1)), Pose()),))
    cloud = PointCloud(np.array([[1.0, 0.0, 0.5]]), None)
    moved = Pose.from_xyz_rpy((0.3, -0.1, 0.0), (0.0, 0.0, 0.5))
    pose = Pose.from_xyz_rpy((1.0, 0.0, 0.5), (0.0, 0.0, 0.2))
    before = ObjectBelief(
        "box", box, pose, 0.9, 0.01, 1.0, yaw_set=YawSet(((0.2, 0.1),)), cloud=cloud, viewpoint=np.zeros(3)
    )
    after = before.moved(moved)
    assert after.pose.yaw == pytest.approx(0.7)
    assert after.yaw_set.arcs == (pytest.approx((0.7, 0.1)),)
    place = [0.3 + np.cos(0.5), -0.1 + np.sin(0.5), 0.5]
    np.testing.assert_allclose(after.pose.position, place)
    assert after.cloud is not None
    np.testing.assert_allclose(after.cloud.points[0], place)
    np.testing.assert_allclose(after.viewpoint, [0.3, -0.1, 0.0])
