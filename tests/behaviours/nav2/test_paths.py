"""Planning without driving, and what is asked of and done to the paths."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.path_pieces import metres_along
from tests.behaviours.at_the_table import failures_of, tick, tree_of
from tests.behaviours.truth import succeeds

PLAN = '<ComputePathToPose goal="{goal}" path="{path}" planner_id="{planner}" error_code="{code}"/>'
GOAL = Pose2D(1.0, -0.6, 0.0)


def planned(session, goal: Pose2D = GOAL) -> Path2D:
    tree = session.load(tree_of(PLAN))
    tree.blackboard.set("goal", goal)
    assert tick(tree, 20) == SUCCESS
    path: Path2D = tree.blackboard.get("path")
    return path


def test_a_path_leads_from_the_base_to_the_goal(driver) -> None:
    path = planned(driver)
    assert np.linalg.norm(path.points[0] - driver.skills.world.base.pose.xy) < 0.01
    assert path.goal == GOAL


def test_without_a_path_the_old_one_is_cleared_and_the_code_reported(driver) -> None:
    tree = driver.load(tree_of(PLAN))
    tree.blackboard.set("goal", GOAL)
    assert tick(tree, 20) == SUCCESS
    tree.blackboard.set("goal", Pose2D(30.0, 0.0, 0.0))
    assert tick(tree, 20) == FAILURE
    assert tree.blackboard.get("path") is None
    assert tree.blackboard.get("code") == "goal_outside"


def test_a_planner_is_chosen_by_its_name(driver) -> None:
    tree = driver.load(tree_of(PLAN))
    tree.blackboard.set("goal", GOAL)
    tree.blackboard.set("planner", "grid_astar")
    assert tick(tree, 20) == SUCCESS
    tree.blackboard.set("planner", "GridBased")
    assert tick(tree, 20) == SUCCESS, "Nav2's name of its planner is the configured one"
    tree.blackboard.set("planner", "Dijkstra")
    assert tick(tree, 20) == FAILURE
    code, words = failures_of(driver)[0]
    assert code == "bad_input"
    assert "Dijkstra" in words


def test_a_start_counts_unless_it_is_not_to_be_used(driver) -> None:
    start = Pose2D(-1.0, -1.0, 0.0)
    body = '<ComputePathToPose goal="1;-0.6;0" start="{start}" use_start="{use}" path="{path}"/>'
    tree = driver.load(tree_of(body))
    tree.blackboard.set("start", start)
    for use, begin in ((True, start.xy), (False, driver.skills.world.base.pose.xy)):
        tree.blackboard.set("use", use)
        assert tick(tree, 20) == SUCCESS
        assert np.linalg.norm(tree.blackboard.get("path").points[0] - begin) < 0.01


@pytest.mark.parametrize(
    ("goals", "status", "reached"),
    [("-1;0.3;0;1;-0.6;0", SUCCESS, -1), ("-1;0.3;0;30;0;0", FAILURE, 0), ("30;0;0", FAILURE, -1), ("", FAILURE, None)],
)
def test_a_path_through_poses_passes_each_or_reports_how_far_it_came(driver, goals, status, reached) -> None:
    body = '<ComputePathThroughPoses goals="{goals}" path="{path}" last_reached_index="{reached}"/>'
    tree = driver.load(tree_of(body))
    tree.blackboard.set("goals", goals)
    assert tick(tree, 20) == status
    assert tree.blackboard.get("reached") == reached
    path = tree.blackboard.get("path")
    if status == SUCCESS:
        assert np.linalg.norm(path.points - (-1.0, 0.3), axis=1).min() < 1e-6
    else:
        assert path is None


def test_a_truncated_path_ends_before_the_goal_and_what_is_around_the_base_is_cut_out(driver) -> None:
    path = planned(driver)
    body = '<TruncatePath input_path="{path}" output_path="{cut}" distance="0.5"/>'
    tree = driver.load(tree_of(body))
    tree.blackboard.set("path", path)
    assert tick(tree) == SUCCESS
    assert np.linalg.norm(tree.blackboard.get("cut").points[-1] - GOAL.xy) == pytest.approx(0.5, abs=1e-6)
    body = '<TruncatePathLocal input_path="{path}" output_path="{cut}" distance_forward="1" distance_backward="0.2"/>'
    tree = driver.load(tree_of(body))
    tree.blackboard.set("path", path)
    assert tick(tree) == SUCCESS
    assert tree.blackboard.get("cut").length == pytest.approx(1.0, abs=0.05)


def test_a_smoothed_path_has_no_corners_and_stays_free(driver) -> None:
    path = planned(driver, Pose2D(1.0, 1.2, 0.0))
    body = '<SmoothPath unsmoothed_path="{path}" smoothed_path="{smooth}" check_for_collisions="true"/>'
    tree = driver.load(tree_of(body))
    tree.blackboard.set("path", path)
    assert tick(tree) == SUCCESS
    smooth = tree.blackboard.get("smooth")
    assert len(smooth.points) > len(path.points)
    assert metres_along(smooth)[-1] <= path.length + 1e-9
    tree = driver.load(tree_of(body.replace("/>", ' smoother_id="{smoother}"/>')))
    tree.blackboard.set("path", path)
    tree.blackboard.set("smoother", "savitzky")
    assert tick(tree) == FAILURE
    assert failures_of(driver)[0][0] == "bad_input"


def test_a_path_is_valid_until_the_lidar_sees_something_on_it(kitchen, chair) -> None:
    session, _ = kitchen(chair)
    path = Path2D(np.array([session.skills.world.base.pose.xy, [1.8, -0.3]]), Pose2D(1.8, -0.3, 0.0))
    body = '<IsPathValid path="{path}" collision_poses="{where}" max_lookahead_distance="{ahead}"/>'
    tree = session.load(tree_of(body))
    tree.blackboard.set("path", path)
    session.skills.base.layer.clear()
    assert tick(tree) == SUCCESS
    session.skills.base.park()
    session.robot.clock.sleep(1.0)
    assert tick(tree) == FAILURE
    (where,) = tree.blackboard.get("where")
    assert where.x == pytest.approx(0.5, abs=0.06)
    tree.blackboard.set("ahead", 1.0)
    assert tick(tree) == SUCCESS
    assert len(session.skills.base.layer.points)
    assert succeeds(session, '<ClearCostmapAroundPose pose="-2;-0.3;0" reset_distance="1"/>')
    assert len(session.skills.base.layer.points)
    assert succeeds(session, '<ClearCostmapAroundPose pose="0.9;-0.3;0" reset_distance="2"/>')
    assert not len(session.skills.base.layer.points)


def test_a_goal_is_near_by_the_path_that_is_left(driver) -> None:
    near = '<IsGoalNearby path="{path}" proximity_threshold="{near}"/>'
    tree = driver.load(tree_of(near))
    tree.blackboard.set("near", 2.0)
    assert tick(tree) == FAILURE
    tree.blackboard.set("path", planned(driver))
    assert tick(tree) == FAILURE
    tree.blackboard.set("near", 5.0)
    assert tick(tree) == SUCCESS
