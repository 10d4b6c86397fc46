from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path
from bestman_bt.messages import Pose


def test_the_tool_moves_on_a_straight_line_and_turns_evenly(kinematics, ready):
    start = kinematics.tool_pose(ready)
    goal = Pose(np.add(start.position, [0.05, 0.1, -0.15]), start.quaternion) @ Pose.from_xyz_rpy(
        (0, 0, 0), (0, 0, 0.4)
    )
    path = cartesian_path(kinematics, ready, goal)
    assert path.complete
    assert path.fraction == 1.0
    direction = (goal.position - start.position) / np.linalg.norm(goal.position - start.position)
    for i, q in enumerate(path.path):
        tool = kinematics.tool_pose(q)
        along = tool.position - start.position
        share = i / (len(path.path) - 1)
        turned = 2 * math.acos(min(1.0, abs(float(tool.quaternion @ start.quaternion))))
        assert np.linalg.norm(along - direction * (along @ direction)) < 1e-4
        assert abs(turned - 0.4 * share) < 1e-3
    assert np.abs(np.diff(path.path, axis=0)).max() < 0.2
    assert np.allclose(kinematics.tool_pose(path.path[-1]).position, goal.position, atol=1e-4)


def test_a_line_that_leaves_the_workspace_ends_early_and_reports_it(kinematics, ready):
    start = kinematics.tool_pose(ready)
    path = cartesian_path(kinematics, ready, Pose(np.add(start.position, [1.0, 0.0, 0.0]), start.quaternion))
    assert not path.complete
    assert 0.0 < path.fraction < 1.0
    assert "inverse kinematics" in path.failure
    assert len(path.path) > 1


def test_a_blocked_line_ends_before_the_obstacle(kinematics, ready):
    start = kinematics.tool_pose(ready)
    floor = start.position[2] - 0.1
    path = cartesian_path(
        kinematics,
        ready,
        Pose(start.position - [0, 0, 0.2], start.quaternion),
        is_valid=lambda q: kinematics.tool_pose(q).position[2] > floor,
    )
    assert not path.complete
    assert "validity" in path.failure
    assert abs(path.fraction - 0.5) < 0.1
    assert kinematics.tool_pose(path.path[-1]).position[2] > floor


def test_a_turn_on_the_spot_is_cut_into_small_steps_the_short_way(kinematics, ready):
    start = kinematics.tool_pose(ready)
    goal = start @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, 0.4))
    path = cartesian_path(kinematics, ready, goal)
    assert len(path.path) == 9
    opposite = Pose(goal.position, -goal.quaternion)
    assert np.allclose(cartesian_path(kinematics, ready, opposite).path, path.path, atol=1e-6)
    assert np.abs(path.path - ready).max() < 0.6


@pytest.mark.parametrize("good", [0, 3, 7])
def test_the_fraction_is_that_of_the_waypoints_which_were_accepted(kinematics, ready, good):
    start = kinematics.tool_pose(ready)
    accepted = []
    path = cartesian_path(
        kinematics,
        ready,
        Pose(start.position - [0, 0, 0.1], start.quaternion),
        is_valid=lambda q: len(accepted) < good and not accepted.append(q),
    )
    assert path.fraction == pytest.approx(good / 10)
    assert len(path.path) == good + 1
    assert np.array_equal(path.path[0], ready)


def test_each_waypoint_goes_on_from_the_one_before(kinematics, ready):
    """A line of 0.3 m: from its start the far end is more than one step of tracking away."""
    start = kinematics.tool_pose(ready)
    goal = Pose(np.add(start.position, [0.0, 0.3, 0.0]), start.quaternion)
    assert kinematics.track(goal, ready) is None
    path = cartesian_path(kinematics, ready, goal)
    assert path.complete
    assert np.allclose(kinematics.tool_pose(path.path[-1]).position, goal.position, atol=1e-4)
