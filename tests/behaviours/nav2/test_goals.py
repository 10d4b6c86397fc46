"""Asking of goals, keeping them up to date, and the codes that tell whether a recovery may help."""

from __future__ import annotations

import pytest

from bestman_bt.engine import FAILURE, SUCCESS, TreeLoadError
from bestman_bt.messages import Goals, Pose2D
from tests.behaviours.at_the_table import tick, tree_of
from tests.behaviours.truth import succeeds, why_not


def here(session) -> Pose2D:
    pose: Pose2D = session.skills.world.base.pose
    return pose


@pytest.mark.slow
def test_a_goal_is_reached_within_its_tolerance_whichever_way_the_base_faces(driver) -> None:
    pose = here(driver)
    assert succeeds(driver, f'<GoalReached goal="{pose.x + 0.2};{pose.y};{pose.theta + 2.0}"/>')
    assert why_not(driver, f'<GoalReached goal="{pose.x + 0.3};{pose.y};{pose.theta}"/>')[0] == "not_at_goal"
    assert succeeds(driver, f'<GoalReached tolerance="0.4" goal="{pose.x + 0.3};{pose.y};{pose.theta}"/>')


@pytest.mark.parametrize(("leaf", "first"), [("GoalUpdated", FAILURE), ("GlobalUpdatedGoal", SUCCESS)])
def test_a_goal_is_updated_once_after_each_change(driver, leaf, first) -> None:
    tree = driver.load(tree_of(f"<{leaf}/>"))
    tree.blackboard.set("goal", Pose2D(1.0, 2.0, 0.0))
    assert tick(tree) == first
    assert tick(tree) == FAILURE
    tree.blackboard.set("goal", Pose2D(1.0, 2.0, 0.0))
    assert tick(tree) == FAILURE
    tree.blackboard.set("goal", Pose2D(1.0, 2.5, 0.0))
    assert tick(tree) == SUCCESS
    assert tick(tree) == FAILURE
    tree.blackboard.set("goals", Goals((Pose2D(),)))
    assert tick(tree) == SUCCESS
    tree.halt()
    assert tick(tree) == first


def test_goals_that_the_base_is_near_to_are_passed_but_for_the_last(driver) -> None:
    pose = here(driver)
    near, far = Pose2D(pose.x + 0.3, pose.y, 0.0), Pose2D(pose.x + 3.0, pose.y, 0.0)
    tree = driver.load(tree_of('<RemovePassedGoals input_goals="{goals}" output_goals="{goals}" radius="0.5"/>'))
    for before, after in (((near, near, far), (far,)), ((far, near), (far, near)), ((near,), (near,))):
        tree.blackboard.set("goals", Goals(before))
        assert tick(tree) == SUCCESS
        assert tree.blackboard.get("goals") == after


def test_a_goal_updater_hands_on_the_goal_or_what_was_written_after_it(driver) -> None:
    body = '<GoalUpdater input_goal="{goal}" output_goal="{chosen}"><AlwaysSuccess/></GoalUpdater>'
    tree = driver.load(tree_of(body))
    given, update, later = Pose2D(1.0, 0.0, 0.0), Pose2D(2.0, 0.0, 0.0), Pose2D(3.0, 0.0, 0.0)
    tree.blackboard.set("goal", given)
    tick(tree)
    assert tree.blackboard.get("chosen") == given
    driver.robot.clock.sleep(0.1)
    tick(tree)
    tree.blackboard.set("goal_update", update)
    tick(tree)
    assert tree.blackboard.get("chosen") == update
    driver.robot.clock.sleep(0.1)
    tick(tree)
    tree.blackboard.set("goal", later)
    tick(tree)
    assert tree.blackboard.get("chosen") == later


def test_an_update_may_come_as_text(driver) -> None:
    tree = driver.load(tree_of('<GoalUpdater input_goal="1;0;0" output_goal="{chosen}"><AlwaysSuccess/></GoalUpdater>'))
    tree.blackboard.set("goal_update", "2;1;0.5")
    tick(tree)
    assert tree.blackboard.get("chosen") == Pose2D(2.0, 1.0, 0.5)


def test_poses_are_near_within_the_tolerance(driver) -> None:
    assert succeeds(driver, '<ArePosesNear ref_pose="1;1;0" target_pose="1.3;1;0"/>')
    assert why_not(driver, '<ArePosesNear ref_pose="1;1;0" target_pose="1.3;1;0" tolerance="0.2"/>')[0] == "not_near"


@pytest.mark.parametrize(
    ("leaf", "code", "helps"),
    [
        ("WouldAPlannerRecoveryHelp", "no_path", True),
        ("WouldAPlannerRecoveryHelp", "goal_outside", False),
        ("WouldAPlannerRecoveryHelp", "", False),
        ("WouldAControllerRecoveryHelp", "blocked", True),
        ("WouldAControllerRecoveryHelp", "lost", False),
    ],
)
def test_only_what_may_pass_is_worth_a_recovery(driver, leaf, code, helps) -> None:
    tree = driver.load(tree_of(f'<{leaf} error_code="{{code}}"/>'))
    tree.blackboard.set("code", code)
    assert tick(tree) == (SUCCESS if helps else FAILURE)


def test_codes_may_be_named(driver) -> None:
    assert succeeds(driver, '<AreErrorCodesPresent error_code="lost" error_codes_to_check="blocked;lost"/>')
    assert (
        why_not(driver, '<AreErrorCodesPresent error_code="lost" error_codes_to_check="blocked"/>')[0] == "other_code"
    )


def test_ports_of_nav2_that_mean_nothing_here_are_taken(driver) -> None:
    driver.load(
        tree_of(
            '<Sequence><Spin spin_dist="1.57" is_recovery="true" server_name="spin" server_timeout="20"/>'
            '<ClearEntireCostmap service_name="local_costmap/clear_entirely_local_costmap"/>'
            '<FollowPath path="{path}" goal_checker_id="general_goal_checker" progress_checker_id="progress_checker"/>'
            '<IsPathValid path="{path}" max_cost="254" layer_name="" server_timeout="10"/>'
            '<DistanceController distance="1.0" global_frame="map" robot_base_frame="base_link">'
            '<ComputePathToPose goal="{goal}" path="{path}" planner_id=""/></DistanceController></Sequence>'
        )
    )
    with pytest.raises(TreeLoadError, match="error_code_id"):
        driver.load(tree_of('<Wait wait_duration="5.0" error_code_ids="{code}"/>'))
