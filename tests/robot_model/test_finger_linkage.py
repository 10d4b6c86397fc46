"""Fingers on linkages: which width belongs to which joint positions, and what a force at the pads takes."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

from bestman_bt.robot_model.compose import combine
from bestman_bt.robot_model.finger_linkage import MimicJoint, all_positions, opening_table
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from tests.robot_model.small_robot import arm_urdf

HANDS = ("panda_hand", "wsg50", "xarm_gripper", "pr2_gripper", "robotiq_2f85")


@pytest.fixture(scope="module", params=HANDS)
def robot(request: pytest.FixtureRequest) -> RobotModel:
    return combine("differential_base", "panda_arm", request.param)


@pytest.fixture(scope="module")
def gripper(robot: RobotModel) -> GripperModel:
    return robot.of(GripperModel)["gripper"]


def gap(robot: RobotModel, width: float) -> float:
    """Between the middles of the fingers along y of the tool, by pinocchio."""
    model = pin.buildModelFromXML(robot.urdf)
    geometry = pin.buildGeomFromUrdfString(model, robot.urdf, pin.GeometryType.COLLISION)
    q = pin.neutral(model)
    for joint, position in robot.of(GripperModel)["gripper"].joint_positions(width).items():
        q[model.joints[model.getJointId(joint)].idx_q] = position
    data, placed = model.createData(), pin.GeometryData(geometry)
    pin.updateGeometryPlacements(model, data, geometry, placed, q)
    pin.updateFramePlacements(model, data)
    tool = data.oMf[model.getFrameId(robot.of(ArmModel)["arm"].tool_frame)]
    places = []
    for finger in robot.of(GripperModel)["gripper"].part.finger_links:
        bodies = [i for i, g in enumerate(geometry.geometryObjects) if model.frames[g.parentFrame].name == finger]
        places.append(np.mean([tool.actInv(placed.oMg[i]).translation[1] for i in bodies]))
    return abs(places[0] - places[1])


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 1.0])
def test_the_fingers_are_as_far_apart_as_the_width_says(robot: RobotModel, gripper: GripperModel, share: float) -> None:
    width = share * gripper.max_width
    assert gap(robot, width) - gap(robot, 0.0) == pytest.approx(width, abs=2e-4)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_width_and_joint_positions_are_inverse(gripper: GripperModel, share: float) -> None:
    width = share * gripper.max_width
    positions = gripper.joint_positions(width)
    assert gripper.width([positions[joint] for joint in gripper.part.joints]) == pytest.approx(width, abs=1e-6)


def test_joints_turn_as_far_per_metre_as_the_transmission_says(gripper: GripperModel) -> None:
    near, far = (gripper.joint_positions(share * gripper.max_width) for share in (0.499, 0.501))
    turned = abs(far[gripper.part.joints[0]] - near[gripper.part.joints[0]])
    assert turned / (0.002 * gripper.max_width) == pytest.approx(
        gripper.transmission(0.5 * gripper.max_width), rel=0.02
    )
    assert gripper.transmission(0.5 * gripper.max_width) <= gripper.fastest_transmission * (1 + 1e-9)


def test_a_hand_that_never_closes_wholly_has_its_least_width_when_it_is_closed() -> None:
    elements = list(ET.fromstring(arm_urdf()))
    mimics = (MimicJoint("right_joint", "left_joint"),)
    table = opening_table(
        elements, ("left_joint",), mimics, ("left_finger", "right_finger"), "palm", (0.03, 0.0), min_width=0.004
    )
    assert table[0] == pytest.approx((0.03, 0.064))
    assert table[-1] == pytest.approx((0.0, 0.004))


def test_followers_of_followers_follow() -> None:
    mimics = [MimicJoint("c", "b", -2.0, 0.1), MimicJoint("b", "a", 0.5)]
    assert all_positions({"a": 1.0}, mimics) == {"a": 1.0, "b": 0.5, "c": -0.9}
