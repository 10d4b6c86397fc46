"""A controller that moves another arm than the robot file's is recognised by its flange's place and by its name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import arm_payload, payload
from hal.hardware.controller_facts import ArmFacts, compare_mounting, compare_tool
from hal.twins.ur_kinematics import URKinematics
from hal.ur.connection import URIdentity

JOINTS = [0.3, -1.9, 1.6, -1.2, -1.4, 0.5]
ELBOW_BENT = [0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]
HOME = np.radians([0.0, -120.0, 110.0, -80.0, -90.0, 0.0]).tolist()
Gravity = tuple[float, float, float]
TCP = pinocchio.SE3(pinocchio.exp3(np.array([0.0, 0.4, 0.2])), np.array([0.01, 0.02, 0.15]))


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot_model("diff_ur5")


@pytest.fixture(scope="module")
def reported(robot: RobotModel) -> URIdentity:
    """By the controller of a UR5e with a tool of its own."""
    pose = URKinematics(robot, "arm").pose(np.array(JOINTS))
    flange = pinocchio.SE3(pinocchio.exp3(np.array(pose[3:])), np.array(pose[:3]))
    poses = [[*p.translation.tolist(), *pinocchio.log3(p.rotation).tolist()] for p in (flange * TCP, TCP)]
    tool_pose, tcp_offset = poses
    mass, torques = payload(robot, "arm_tool0").mass, holding_torques(robot)
    return URIdentity("UR5", "20215500000", tcp_offset, JOINTS, tool_pose, mass, torques)


def holding_torques(
    robot: RobotModel, gravity: Gravity = (0.0, 0.0, -9.81), positions: list[float] = JOINTS
) -> list[float]:
    """Of the arm at rest, N m."""
    model, joints = pinocchio.buildModelFromXML(robot.urdf), robot.of(ArmModel)["arm"].joint_names
    model.gravity.linear = np.array(gravity)
    q = pinocchio.neutral(model)
    for name, position in zip(joints, positions, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = position
    torques = pinocchio.computeGeneralizedGravity(model, model.createData(), q)
    return [float(torques[model.joints[model.getJointId(name)].idx_v]) for name in joints]


def held(robot: RobotModel, reported: URIdentity, positions: list[float], gravity: Gravity) -> ArmFacts:
    """Of a controller with this direction of gravity, at these joints."""
    return replace(reported, joints=positions, torques=holding_torques(robot, gravity, positions)).arm_facts()


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
    robot: RobotModel, reported: URIdentity, gravity: Gravity, agrees: bool
) -> None:
    compared = compare_mounting(robot, "arm", held(robot, reported, JOINTS, gravity))
    assert compared is not None
    assert compared.agrees is agrees, compared.text
    assert ("the arm's place or the masses of its links" in compared.text) is not agrees


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("positions", "hidden"), [(ELBOW_BENT, 10.0), ([0.0, -0.3, 0.6, -1.5, -1.5, 0.0], 20.0), (HOME, 27.0)]
)
def test_the_tilt_that_may_remain_hidden_is_reported(
    robot: RobotModel, reported: URIdentity, positions: list[float], hidden: float, axis: int, sign: float
) -> None:
    as_built = compare_mounting(robot, "arm", held(robot, reported, positions, (0.0, 0.0, -9.81)))
    assert as_built is not None
    assert as_built.agrees
    assert as_built.measured["hidden_deg"] == hidden
    assert f"tilted by up to {hidden:.0f}° might not show" in as_built.text
    tilt, gravity = np.radians(hidden + 1.0), [0.0, 0.0, 0.0]
    gravity[axis], gravity[2] = sign * 9.81 * np.sin(tilt), -9.81 * np.cos(tilt)
    tilted = compare_mounting(robot, "arm", held(robot, reported, positions, (gravity[0], gravity[1], gravity[2])))
    assert tilted is not None
    assert not tilted.agrees


@pytest.mark.parametrize(
    ("gravity", "agrees"),
    [((0.0, 0.0, -9.81), None), ((0.0, 0.0, 9.81), None), ((9.81, 0.0, 0.0), False), ((1.0, 0.0, -9.76), False)],
)
def test_an_upright_arm_shows_a_tilt_but_not_that_it_hangs(
    robot: RobotModel, reported: URIdentity, gravity: Gravity, agrees: bool | None
) -> None:
    upright = [0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0]
    compared = compare_mounting(robot, "arm", held(robot, reported, upright, gravity))
    assert (None if compared is None else compared.agrees) is agrees


def test_torques_are_compared_with_the_controllers_payload(robot: RobotModel, reported: URIdentity) -> None:
    stretched, kinematics, step = [0.0] * 6, URKinematics(robot, "arm"), 1e-5 * np.eye(6)
    facts = held(robot, reported, stretched, (0.0, 0.0, -9.81))
    rise = np.array([(kinematics.pose(one)[2] - kinematics.pose(-one)[2]) / 2e-5 for one in step])
    heavier = kinematics.holding_torques(np.zeros(6), 2.0)
    assert heavier == pytest.approx(np.array(holding_torques(robot, positions=stretched)) + 2.0 * 9.81 * rise, abs=1e-6)
    loaded = replace(facts, payload=reported.payload + 2.0, holding_torques=heavier)
    as_loaded = compare_mounting(robot, "arm", loaded)
    assert as_loaded is not None
    assert as_loaded.measured["apart_nm"] < 1e-6
    unloaded = compare_mounting(robot, "arm", replace(loaded, payload=reported.payload))
    assert unloaded is not None
    assert not unloaded.agrees


@pytest.mark.parametrize("model", [None, "ur5e"])
def test_the_arm_of_the_robot_file_is_taken_whatever_tool_is_set(
    robot: RobotModel, reported: URIdentity, model: str | None
) -> None:
    assert reported.mismatch(robot, "arm", model) is None


@pytest.mark.parametrize("part", ["ur5_arm", "ur10e_arm"])
def test_another_arm_is_refused_with_what_the_parts_are(reported: URIdentity, part: str) -> None:
    why = reported.mismatch(load_robot_model("diff_ur5", {"parts.arm.part": part}), "arm", None)
    assert why is not None
    assert "mm from that of the robot file's arm" in why
    assert "ur5e_arm" in why


def test_a_name_that_the_option_does_not_say_is_refused(robot: RobotModel, reported: URIdentity) -> None:
    assert "calls its arm UR5" in (reported.mismatch(robot, "arm", "ur10e") or "")


def test_a_payload_that_is_far_from_the_hands_is_refused(robot: RobotModel, reported: URIdentity) -> None:
    assert "counts on 0.00 kg" in (replace(reported, payload=0.0).mismatch(robot, "arm", None) or "")


def test_what_is_held_adds_to_the_hand_in_the_flange(robot: RobotModel) -> None:
    hand, held = arm_payload(robot, "arm"), arm_payload(robot, "arm", 2.0, (0.0, 0.0, 0.05))
    assert held.mass == pytest.approx(hand.mass + 2.0)
    moment = held.mass * held.centre - hand.mass * hand.centre
    model = pinocchio.buildModelFromXML(robot.urdf)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    flange, tool = (data.oMf[model.getFrameId(name)] for name in ("arm_tool0", robot.of(ArmModel)["arm"].tool_frame))
    assert moment / 2.0 == pytest.approx(flange.actInv(tool).act(np.array([0.0, 0.0, 0.05])), abs=1e-6)


def test_a_tool_that_is_neither_the_flange_nor_the_files_is_reported(robot: RobotModel, reported: URIdentity) -> None:
    for tcp_offset, agrees in (
        (reported.tcp_offset, False),
        ([0.0] * 6, True),
        ([0.0, 0.0, 0.0015, 0.0, 0.0, 0.0], True),
    ):
        compared = compare_tool(robot, "arm", replace(reported, tcp_offset=tcp_offset).arm_facts())
        assert compared is not None
        assert compared.agrees is agrees
