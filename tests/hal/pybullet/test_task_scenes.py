"""The scenes of the long tasks stand still until somebody touches something."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.ground_truth import GroundTruth

WITH_OBJECTS = ("cup_in_drawer", "cup_in_fridge", "pick_place_table", "put_away", "set_table", "untidy_table")


@pytest.mark.slow
@pytest.mark.parametrize("name", [*WITH_OBJECTS, "chest_room", "fridge_room", "microwave_room"])
def test_nothing_moves_for_a_second(robot_model: RobotModel, name: str) -> None:
    world = draw_world(load_scene(name), seed=11)
    assert bool(world.objects) is (name in WITH_OBJECTS)
    with PyBulletRobot(robot_model, world) as robot:
        truth = GroundTruth(robot)
        robot.clock.sleep(1.0)
        for thing in world.objects:
            pose = truth.object_pose(thing.name)
            np.testing.assert_allclose(pose.position, thing.pose.position, atol=5e-4)
            assert pose.tilt < 0.01
        assert all(abs(truth.articulation_position(door)) < 1e-4 for door in truth.articulation_names)
        record = robot.audit_record()
        assert not record.contacts
        assert all(overlap.depth < 5e-4 for overlap in record.penetrations)
