from __future__ import annotations

import pytest

from bestman_bt.robot_model.model import ArmModel, GripperModel, JointGroupModel


def test_every_joint_but_the_wheels_is_reported_by_name(joints, model):
    expected = {*model.of(ArmModel)["arm"].joint_names, *model.of(GripperModel)["gripper"].part.joints}
    expected |= set(model.of(JointGroupModel)["head"].joint_names)
    assert set(joints.positions()) == expected


def test_positions_are_those_of_the_posture_in_which_the_robot_started(joints, model):
    positions = joints.positions()
    for name, value in model.postures["carry"].items():
        assert positions[name] == pytest.approx(value, abs=0.01)


def test_the_joints_of_a_gripper_share_its_width(joints, robot, model):
    positions = joints.positions()
    fingers = [positions[name] for name in model.of(GripperModel)["gripper"].part.joints]
    assert sum(fingers) == pytest.approx(robot.parts["gripper"].width())
    assert fingers[0] == fingers[1]


def test_readings_cannot_be_changed(joints):
    with pytest.raises(TypeError):
        joints.positions()["panda_joint1"] = 0.0
