"""Nav2's trees with replanning and recovery drive the base, also where something unknown is in the way."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import RUNNING, SUCCESS
from bestman_bt.messages import Goals, Path2D, Pose2D
from tests.behaviours.at_the_table import PERIOD, fastest, tick, tree_of
from tests.behaviours.truth import audited, known_world

pytestmark = pytest.mark.slow

TO_POSE = "navigate_to_pose_w_replanning_and_recovery"
THROUGH_POSES = "navigate_through_poses_w_replanning_and_recovery"
BESIDE_THE_TABLE = Pose2D(2.0, -0.4, 0.0)
UPSTREAM = Path(__file__).parent / "upstream"
"""Trees of Nav2 as they are."""


def drive(session, truth, tree, seconds=90.0):
    """Tick to the end; the status, the true poses on the way and the paths that were driven."""
    poses, paths = [], []
    status = RUNNING
    for _ in range(int(seconds / PERIOD)):
        status = tick(tree)
        poses.append(truth.base_pose().to_pose2d())
        path = tree.blackboard.get("path")
        if isinstance(path, Path2D) and (not paths or path is not paths[-1]):
            paths.append(path)
        if status != RUNNING:
            break
    return status, poses, paths


def test_it_drives_to_a_pose_in_the_kitchen(kitchen) -> None:
    session, truth = kitchen()
    tree = session.load(TO_POSE)
    tree.blackboard.set("goal", BESIDE_THE_TABLE)
    status, poses, _ = drive(session, truth, tree)
    assert status == SUCCESS
    assert poses[-1].distance_to(BESIDE_THE_TABLE) < 0.02
    assert not audited(session).collisions


def test_around_a_chair_that_the_map_does_not_know_it_plans_anew(kitchen, chair) -> None:
    session, truth = kitchen(chair)
    tree = session.load(TO_POSE)
    tree.blackboard.set("goal", BESIDE_THE_TABLE)
    status, poses, paths = drive(session, truth, tree)
    assert status == SUCCESS
    assert poses[-1].distance_to(BESIDE_THE_TABLE) < 0.02
    assert not audited(session).collisions
    assert len(paths) > 1
    assert min(pose.distance_to(Pose2D(0.9, -0.3, 0.0)) for pose in poses) > 0.4


def test_a_goal_that_is_changed_on_the_way_is_driven_to_instead(kitchen) -> None:
    session, truth = kitchen()
    tree = session.load(TO_POSE)
    tree.blackboard.set("goal", BESIDE_THE_TABLE)
    tick(tree, 100)
    instead = Pose2D(-0.8, -1.0, 1.0)
    tree.blackboard.set("goal", instead)
    status, poses, _ = drive(session, truth, tree)
    assert status == SUCCESS
    assert poses[-1].distance_to(instead) < 0.02


def test_a_path_that_is_planned_anew_each_second_is_driven_to_its_end(kitchen) -> None:
    session, truth = kitchen(seed=11)
    body = (
        '<PipelineSequence><RateController hz="1.0"><ComputePathToPose goal="{goal}" path="{path}"/></RateController>'
        '<FollowPath path="{path}"/></PipelineSequence>'
    )
    tree = session.load(tree_of(body))
    goal = Pose2D(2.46, -0.512, 0.0)
    tree.blackboard.set("goal", goal)
    status, poses, _ = drive(session, truth, tree, seconds=60.0)
    assert status == SUCCESS
    assert poses[-1].distance_to(goal) < 0.02


def test_halted_it_leaves_nothing_moving(kitchen) -> None:
    session, _ = kitchen()
    tree = session.load(TO_POSE)
    tree.blackboard.set("goal", BESIDE_THE_TABLE)
    tick(tree, 100)
    assert fastest(session) > 0.2
    tree.halt()
    session.robot.clock.sleep(1.0)
    assert fastest(session) < 0.02


def test_it_drives_through_poses_in_their_order(kitchen) -> None:
    session, truth = kitchen()
    tree = session.load(THROUGH_POSES)
    goals = Goals((Pose2D(-0.9, 0.3, 0.0), Pose2D(1.0, -0.6, 0.0), BESIDE_THE_TABLE))
    tree.blackboard.set("goals", goals)
    status, poses, _ = drive(session, truth, tree)
    assert status == SUCCESS
    nearest = [min(range(len(poses)), key=lambda i: poses[i].distance_to(goal)) for goal in goals]
    assert nearest == sorted(nearest)
    assert all(poses[i].distance_to(goal) < 0.15 for i, goal in zip(nearest, goals, strict=True))
    assert poses[-1].distance_to(BESIDE_THE_TABLE) < 0.02


def test_a_goal_in_a_wall_fails_and_is_reported(kitchen) -> None:
    session, truth = kitchen()
    tree = session.load(TO_POSE)
    tree.blackboard.set("goal", Pose2D(0.0, 1.5, 0.0))
    status, _, _ = drive(session, truth, tree)
    assert status not in (SUCCESS, RUNNING)
    assert {failure.error_code for failure in session.skills.failures} >= {"goal_blocked"}


@pytest.mark.parametrize("name", [path.stem for path in sorted(UPSTREAM.glob("*.xml"))])
def test_nav2s_own_trees_drive_through_the_apartment_unmodified(name: str) -> None:
    with known_world(load_run("navigate_apartment", seed=6)) as (session, truth):
        tree = session.load(UPSTREAM / f"{name}.xml")
        goal = tree.blackboard["goal"]
        start = truth.base_pose().to_pose2d()
        status, poses, _ = drive(session, truth, tree)
        assert status == SUCCESS
        assert start.distance_to(goal) > 2.0
        assert poses[-1].distance_to(goal) < 0.03
        assert not audited(session).collisions
