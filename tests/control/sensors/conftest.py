from __future__ import annotations

from dataclasses import replace

import pytest

from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.scene import World
from hal.simulation.ground_truth import GroundTruth
from tests.default_engine import DefaultRobot


@pytest.fixture(scope="session")
def model() -> RobotModel:
    late = {"parts.head_camera.set.latency": "50 ms", "parts.lidar.set.latency": "40 ms"}
    return load_robot_model("diff_panda", late)


@pytest.fixture(scope="session")
def kinematics(model) -> ForwardKinematics:
    return ForwardKinematics(model)


@pytest.fixture(scope="module")
def world() -> World:
    """The kitchen, with the robot about 1 m before the table."""
    world = draw_world(load_scene("kitchen"), 1)
    return replace(world, robot_start=Pose2D(2.4, -0.4, 0.1))


@pytest.fixture(scope="module")
def robot(model, world):
    robot = DefaultRobot(model, world, seed=1)
    with robot:
        yield robot


@pytest.fixture(scope="module")
def truth(robot) -> GroundTruth:
    return GroundTruth(robot)


@pytest.fixture(scope="module")
def joints(robot, model) -> JointStateSensor:
    return JointStateSensor(robot.parts, model)
