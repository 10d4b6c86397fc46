from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bestman_bt.messages import Handle, Pose
from bestman_bt.perception.grasp_pose.hand_poses import handle_motion


def handle(**more: Any) -> Handle:
    place = Pose(np.array([1.0, 0.5, 0.9]))
    values = {"opening_direction": np.array([-1.0, 0.0, 0.0]), "confidence": 1.0, "position_std": 0.0, **more}
    return Handle("bar", place, 0.007, 0.2, 0.04, **values)


def test_a_drawer_moves_along_its_opening_direction() -> None:
    moved = handle_motion(handle(joint="prismatic"), 0.05) @ handle().pose
    np.testing.assert_allclose(moved.position, [0.95, 0.5, 0.9])
    np.testing.assert_allclose(moved.rotation, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("axis", [1.0, -1.0])
def test_a_door_turns_about_its_hinge_to_the_side_that_opens(axis: float) -> None:
    door = handle(joint="revolute", hinge=np.array([1.0, 0.0, 0.0]), hinge_direction=np.array([0.0, 0.0, axis]))
    moved = handle_motion(door, 0.25) @ door.pose
    np.testing.assert_allclose(moved.position, [1 - 0.5 * math.sin(0.5), 0.5 * math.cos(0.5), 0.9], atol=1e-12)
    assert moved.yaw == pytest.approx(0.5)


def test_seen_from_elsewhere_a_door_turns_about_the_same_hinge() -> None:
    other = Pose.from_xyz_rpy((0.4, -1.3, 0.2), (0.1, -0.2, 2.3))
    door = handle(joint="revolute", hinge=np.array([1.0, 0.0, 0.0]), hinge_direction=np.array([0.0, 0.0, 1.0]))
    moved = handle_motion(door.seen_from(other), 0.25)
    np.testing.assert_allclose(
        moved.apply(other.apply(np.eye(3))), other.apply(handle_motion(door, 0.25).apply(np.eye(3))), atol=1e-12
    )


def test_without_a_known_hinge_it_moves_straight() -> None:
    moved = handle_motion(handle(joint="revolute"), 0.05) @ handle().pose
    np.testing.assert_allclose(moved.position, [0.95, 0.5, 0.9])
