"""A controller that moves another arm than the robot file's is told from the place of its flange, and by its name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import arm_payload, payload
from hal.hardware.controller_facts import compare_mounting, compare_tool
from hal.twins.ur_kinematics import URKinematics
from hal.ur.connection import URIdentity

JOINTS = [0.3, -1.9, 1.6, -1.2, -1.4, 0.5]
TCP = pinocchio.SE3(pinocchio.exp3(np.array([0.0, 0.4, 0.2])), np.array([0.01, 0.02, 0.15]))


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot_model("diff_ur5")


@pytest.fixture(scope="module")
def told(robot: RobotModel) -> URIdentity:
    """By the controller of a UR5e with a tool of its own."""
    pose = URKinematics(robot, "arm").pose(np.array(JOINTS))
    flange = pinocchio.SE3(pinocchio.exp3(np.array(pose[3:])), np.array(pose[:3]))
    poses = [[*p.translation.tolist(), *pinocchio.log3(p.rotation).tolist()] for p in (flange * TCP, TCP)]
    tool_pose, tcp_offset = poses
    mass, torques = payload(robot, "arm_tool0").mass, holding_torques(robot)
    return URIdentity("UR5", "20215500000", tcp_offset, JOINTS, tool_pose, mass, torques)


def holding_torques(robot: RobotModel, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> list[float]:
    """Of the arm at rest, N m."""
    model, joints = pinocchio.buildModelFromXML(robot.urdf), robot.of(ArmModel)["arm"].joint_names
    model.gravity.linear = np.array(gravity)
    q = pinocchio.neutral(model)
    for name, position in zip(joints, JOINTS, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = position
    torques = pinocchio.computeGeneralizedGravity(model, model.createData(), q)
    return [float(torques[model.joints[model.getJointId(name)].idx_v]) for name in joints]


@pytest.mark.parametrize(
    ("gravity", "agrees"),
    [
        ((0.0, 0.0, -9.81), True),
        ((0.0, 0.0, -9.4), True),
        ((0.0, 0.0, 9.81), False),
        ((9.81, 0.0, 0.0), False),
        ((0.0, 9.81, 0.0), False),
        ((0.0, 6.94, -6.94), False),
    ],
)
def test_a_mounting_that_the_file_does_not_have_shows_in_the_joint_torques(
    robot: RobotModel, told: URIdentity, gravity: tuple[float, float, float], agrees: bool
) -> None:
    facts = replace(told, torques=holding_torques(robot, gravity)).arm_facts()
    compared = compare_mounting(robot, "arm", facts)
    assert compared is not None
    assert compared.agrees is agrees, compared.text


def test_an_upright_arm_does_not_show_how_it_is_mounted(robot: RobotModel, told: URIdentity) -> None:
    upright = replace(told, joints=[0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0], torques=[0.0] * 6)
    assert compare_mounting(robot, "arm", upright.arm_facts()) is None


@pytest.mark.parametrize("model", [None, "ur5e"])
def test_the_arm_of_the_robot_file_is_taken_whatever_tool_is_set(
    robot: RobotModel, told: URIdentity, model: str | None
) -> None:
    assert told.mismatch(robot, "arm", model) is None


@pytest.mark.parametrize("part", ["ur5_arm", "ur10e_arm"])
def test_another_arm_is_refused_with_what_the_parts_are(told: URIdentity, part: str) -> None:
    why = told.mismatch(load_robot_model("diff_ur5", {"parts.arm.part": part}), "arm", None)
    assert why is not None
    assert "mm from that of the robot file's arm" in why
    assert "ur5e_arm" in why


def test_a_name_that_the_option_does_not_say_is_refused(robot: RobotModel, told: URIdentity) -> None:
    assert "calls its arm UR5" in (told.mismatch(robot, "arm", "ur10e") or "")


def test_a_payload_that_is_far_from_the_hands_is_refused(robot: RobotModel, told: URIdentity) -> None:
    assert "counts on 0.00 kg" in (replace(told, payload=0.0).mismatch(robot, "arm", None) or "")


def test_what_is_held_adds_to_the_hand_in_the_flange(robot: RobotModel) -> None:
    hand, held = arm_payload(robot, "arm"), arm_payload(robot, "arm", 2.0, (0.0, 0.0, 0.05))
    assert held.mass == pytest.approx(hand.mass + 2.0)
    moment = held.mass * held.centre - hand.mass * hand.centre
    model = pinocchio.buildModelFromXML(robot.urdf)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    flange, tool = (data.oMf[model.getFrameId(name)] for name in ("arm_tool0", robot.of(ArmModel)["arm"].tool_frame))
    assert moment / 2.0 == pytest.approx(flange.actInv(tool).act(np.array([0.0, 0.0, 0.05])), abs=1e-6)


def test_a_tool_that_is_neither_the_flange_nor_the_files_is_reported(robot: RobotModel, told: URIdentity) -> None:
    for tcp_offset, agrees in ((told.tcp_offset, False), ([0.0] * 6, True), ([0.0, 0.0, 0.0015, 0.0, 0.0, 0.0], True)):
        compared = compare_tool(robot, "arm", replace(told, tcp_offset=tcp_offset).arm_facts())
        assert compared is not None
        assert compared.agrees is agrees
