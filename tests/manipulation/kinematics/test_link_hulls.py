"""The shapes of links as corners of convex hulls, and what a robot's body fills beside its arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from bestman_bt.manipulation.kinematics.link_hulls import body_between, link_hulls
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel, RobotModel
from tests.manipulation.two_arms import BASE, BASE_YAW, two_arms


def hull_of(geometry: str, origin: str = 'xyz="0.3 0 0.1" rpy="0 1.5707963267948966 0"') -> np.ndarray:
    """Corners (N, 3) of one shape of the link ``tip``, which hangs on a turned joint."""
    urdf = (
        '<robot name="one"><link name="base"/><joint name="j" type="fixed"><parent link="base"/><child link="tip"/>'
        f'<origin xyz="1 2 3" rpy="0 0 1"/></joint><link name="tip"><collision><origin {origin}/>'
        f"<geometry>{geometry}</geometry></collision></link></robot>"
    )
    (corners,) = link_hulls(RobotModel("one", urdf, "base"))["tip"]
    return corners


def test_a_box_has_its_corners_where_it_lies_in_the_link() -> None:
    corners = hull_of('<box size="0.2 0.4 0.6"/>')
    assert len(corners) == 8
    assert corners.min(axis=0) == pytest.approx((0.0, -0.2, 0.0))
    assert corners.max(axis=0) == pytest.approx((0.6, 0.2, 0.2))


def test_a_cylinder_is_a_prism_within_it_from_end_to_end() -> None:
    corners = hull_of('<cylinder radius="0.1" length="0.4"/>')
    assert corners.min(axis=0) == pytest.approx((0.1, -0.1, 0.0))
    assert corners.max(axis=0) == pytest.approx((0.5, 0.1, 0.2))
    assert np.hypot(corners[:, 1], corners[:, 2] - 0.1) == pytest.approx(0.1)


def test_a_ball_is_the_box_around_it() -> None:
    corners = hull_of('<sphere radius="0.1"/>')
    assert np.ptp(corners, axis=0) == pytest.approx((0.2, 0.2, 0.2))


def test_a_mesh_in_millimetres_has_its_scale_once_and_no_inner_corners(tmp_path: Path) -> None:
    outer, inner = trimesh.creation.box((100, 200, 300)), trimesh.creation.box((10, 10, 10))
    trimesh.util.concatenate([outer, inner]).export(tmp_path / "part.stl")
    corners = hull_of(f'<mesh filename="{tmp_path / "part.stl"}" scale="0.001 0.001 0.001"/>', 'xyz="1 0 0"')
    assert len(corners) == 8
    assert corners.min(axis=0) == pytest.approx((0.95, -0.1, -0.15), abs=1e-6)
    assert corners.max(axis=0) == pytest.approx((1.05, 0.1, 0.15), abs=1e-6)


def test_bodies_that_an_arm_does_not_move_are_returned_between_two_heights_in_the_base_frame() -> None:
    """The post is 0.1 by 0.3 m and 0.5 m high about the root, the base frame 0.3 m above its foot."""
    robot = two_arms()
    positions = dict.fromkeys(
        [name for side in robot.of(ArmModel) for name in robot.of(ArmModel)[side].joint_names], 0.0
    )
    base_from_root = Pose.from_xyz_rpy(BASE, (0.0, 0.0, BASE_YAW)).inverse()
    post = base_from_root.apply(np.array([[x, y, 0.0] for x in (-0.05, 0.05) for y in (-0.15, 0.15)]))[:, :2]
    lower, upper = body_between(robot, positions, "left", -0.1, 0.1)
    assert lower == pytest.approx(post.min(axis=0))
    assert upper == pytest.approx(post.max(axis=0))
    right = base_from_root.apply(np.array([[0.0, -0.25, 0.8]]))[0, :2]
    lower, upper = body_between(robot, positions, "left", 0.4, 0.8)
    assert np.all((lower < right) & (right < upper))
    assert np.all(upper - lower < 0.16)
    assert body_between(robot, positions, "left", 2.0, 3.0) is None
    assert body_between(robot, positions, "left", -2.0, -1.0) is None
