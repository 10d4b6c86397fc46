from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.robot_model.sensor_parts import CameraPart


def test_any_link_of_the_arm_agrees_with_the_arm_kinematics(panda, arm, kinematics, ready):
    pose = ForwardKinematics(panda).pose(arm.tool_frame, dict(zip(arm.joint_names, ready, strict=True)))
    assert np.allclose(pose.matrix, kinematics.tool_pose(ready).matrix, atol=1e-9)


def test_a_camera_on_a_tilting_head_looks_down(diff_panda):
    forward = ForwardKinematics(diff_panda)
    camera = diff_panda.of(CameraPart)["head_camera"].optical_frame
    level = forward.pose(camera, {})
    tilted = forward.pose(camera, {"head_tilt_joint": 0.5})
    turned = forward.pose(camera, {"head_pan_joint": 0.5})
    assert np.allclose(level.rotation[:, 2], [1, 0, 0], atol=1e-6)
    assert np.allclose(tilted.rotation[:, 2], [np.cos(0.5), 0, -np.sin(0.5)], atol=1e-6)
    assert np.allclose(turned.rotation[:, 2], [np.cos(0.5), np.sin(0.5), 0], atol=1e-6)


def test_wheels_that_turn_without_end_have_an_angle_as_any_joint(diff_panda):
    wheel = diff_panda.of(BaseModel)["base"].part.wheel_joints[0]
    link = wheel.removesuffix("_joint")
    forward = ForwardKinematics(diff_panda)
    start, turned = forward.pose(link, {}), forward.pose(link, {wheel: 7.0})
    assert np.allclose(start.position, turned.position)
    angle = 2 * np.arccos(min(1.0, abs(start.quaternion @ turned.quaternion)))
    assert angle == pytest.approx(7.0 - 2 * np.pi, abs=1e-6)


def test_poses_can_be_asked_in_another_frame(diff_panda):
    forward = ForwardKinematics(diff_panda)
    home = diff_panda.postures["home"]
    base_from_hand = forward.pose("panda_hand", home)
    tool_from_hand = forward.pose("panda_hand", home, reference="panda_grasptarget")
    base_from_tool = forward.pose("panda_grasptarget", home)
    assert np.allclose((base_from_tool @ tool_from_hand).matrix, base_from_hand.matrix, atol=1e-9)


def test_unknown_frames_and_joints_and_nan_are_refused_by_name(diff_panda):
    forward = ForwardKinematics(diff_panda)
    with pytest.raises(ManipulationError, match=r"no frame 'elbow'; it has .*panda_link4"):
        forward.pose("elbow", {})
    with pytest.raises(ManipulationError, match=r"no movable joint 'knee'; it has .*panda_joint4"):
        forward.pose("panda_hand", {"knee": 0.0})
    with pytest.raises(ManipulationError, match="'panda_joint4' should be finite"):
        forward.pose("panda_hand", {"panda_joint4": float("nan")})
