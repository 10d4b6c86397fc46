"""FollowPath drives along a path, and goes over to the next one while it drives."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import Path2D, Pose2D
from tests.behaviours.at_the_table import failures_of, tick, tree_of

pytestmark = pytest.mark.slow

FOLLOW = '<FollowPath path="{path}" controller_id="{controller}" error_code="{code}"/>'


def straight(start: Pose2D, goal: Pose2D) -> Path2D:
    return Path2D(np.array([start.xy, goal.xy]), goal)


def test_another_path_is_taken_over_without_slowing_down(kitchen) -> None:
    session, _ = kitchen()
    base = session.skills.base
    tree = session.load(tree_of(FOLLOW))
    tree.blackboard.set("path", straight(base_pose(session), Pose2D(0.9, -0.3, 0.0)))
    while base.velocity().vx < 0.55:
        assert tick(tree) == RUNNING
    speeds = []
    for shift in (0.05, 0.0, 0.1):
        tree.blackboard.set("path", straight(base_pose(session), Pose2D(0.9, -0.3 + shift, 0.0)))
        for _ in range(8):
            assert tick(tree) == RUNNING
            speeds.append(base.velocity().vx)
    assert min(speeds) > 0.5
    assert tick(tree, 400) == SUCCESS
    assert base_pose(session).distance_to(Pose2D(0.9, -0.2, 0.0)) < 0.02


def test_a_path_that_is_cleared_is_driven_to_its_end(kitchen) -> None:
    session, _ = kitchen()
    goal = Pose2D(-1.2, -0.3, 0.0)
    tree = session.load(tree_of(FOLLOW))
    tree.blackboard.set("path", straight(base_pose(session), goal))
    tick(tree, 10)
    tree.blackboard.set("path", None)
    assert tick(tree, 400) == SUCCESS
    assert base_pose(session).distance_to(goal) < 0.02


def test_a_named_controller_drives_this_path_and_none_after_it(kitchen) -> None:
    session, _ = kitchen()
    own = type(session.skills.base.own_follower).__name__
    tree = session.load(tree_of(FOLLOW))
    tree.blackboard.set("controller", "dwa")
    goal = Pose2D(-0.6, -0.3, 0.0)
    tree.blackboard.set("path", straight(base_pose(session), goal))
    tick(tree, 5)
    assert type(session.skills.base.follower).__name__ == "DWA"
    assert tick(tree, 400) == SUCCESS
    assert base_pose(session).distance_to(goal) < 0.02
    session.skills.base.drive(-0.1)
    assert type(session.skills.base.follower).__name__ == own


def test_no_path_and_an_unknown_controller_are_reported(driver) -> None:
    tree = driver.load(tree_of(FOLLOW))
    assert tick(tree) == FAILURE
    assert failures_of(driver)[0][0] == "no_path"
    tree.blackboard.set("path", straight(base_pose(driver), Pose2D(0.0, 0.0, 0.0)))
    tree.blackboard.set("controller", "Follow")
    assert tick(tree) == FAILURE
    code, words = failures_of(driver)[0]
    assert code == "bad_input"
    assert "pure_pursuit" in words


def base_pose(session) -> Pose2D:
    pose: Pose2D = session.skills.world.base.pose
    return pose
