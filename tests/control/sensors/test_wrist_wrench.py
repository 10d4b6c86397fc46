"""What touches the hand is told apart from the hand's weight and the sensor's offset."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.touch import WristWrench
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.scene.scene import World
from hal.api import Arm, ForceTorque
from tests.default_engine import DefaultRobot


@pytest.fixture(scope="module")
def robot():
    with DefaultRobot(load_robot_model("diff_panda"), World("empty", 0, (), (), (), Pose2D(0, 0, 0), {})) as robot:
        yield robot


@pytest.fixture
def wrist(robot) -> WristWrench:
    sensor = robot.part("wrist_force_torque", ForceTorque)
    return WristWrench(sensor, ForwardKinematics(robot.model), JointStateSensor(robot.parts, robot.model), robot.clock)


def tare(robot, wrist: WristWrench) -> None:
    wrist.tare()
    while wrist.taring:
        robot.clock.sleep(0.05)


def mean_force(robot, wrist: WristWrench) -> float:
    forces = []
    for _ in range(20):
        robot.clock.sleep(1 / 60)
        forces.append(wrist.contact().force)
    return float(np.linalg.norm(np.mean(forces, axis=0)))


@pytest.mark.slow
def test_a_free_hand_feels_nothing_in_whatever_posture_once_the_offset_is_known(robot, wrist):
    robot.clock.sleep(0.5)
    assert not wrist.tared
    assert mean_force(robot, wrist) > 0.3  # the sensor's own offset
    tare(robot, wrist)
    assert wrist.tared
    for posture in ([0, -0.785, 0, -2.356, 0, 1.571, 0.785], [0.3, -0.6, 0.2, -2.0, 0.4, 2.4, 0.2]):
        robot.part("arm", Arm).move_to(posture, 0.5)
        robot.clock.sleep(4.0)
        assert mean_force(robot, wrist) < 0.2


def test_no_offset_is_learned_while_the_hand_moves(robot, wrist):
    robot.part("arm", Arm).move_to([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
    tare(robot, wrist)
    assert not wrist.tared
    robot.clock.sleep(3.0)


def test_the_wrench_at_the_tool_has_the_same_force_and_its_own_lever(robot, wrist):
    tare(robot, wrist)
    kinematics = ForwardKinematics(robot.model)
    joints = JointStateSensor(robot.parts, robot.model).positions()
    at_sensor = wrist.contact_at(kinematics.pose(wrist.frame, joints))
    at_tool = wrist.contact_at(kinematics.pose(robot.model.of(ArmModel)["arm"].tool_frame, joints))
    np.testing.assert_allclose(at_tool.force, at_sensor.force, atol=1e-12)
    lever = kinematics.pose(wrist.frame, joints).position
    lever = lever - kinematics.pose(robot.model.of(ArmModel)["arm"].tool_frame, joints).position
    np.testing.assert_allclose(at_tool.torque - at_sensor.torque, np.cross(lever, at_sensor.force), atol=1e-12)
