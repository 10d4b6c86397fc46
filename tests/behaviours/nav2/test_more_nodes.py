"""Nav2's leaves for goals, paths, time and distance, its sequences, Cancel… nodes, and what has no counterpart here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.nav2 import lacking
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import Goals, Path2D, Pose2D, Twist2D
from bestman_bt.registry import BEHAVIOURS
from bestman_bt.world_model.world_model import BasePose
from tests.behaviours.scripted import UNDER_WAY, codes, load, run, scripted_skills

A, B, C = Pose2D(1.0, 0.0, 0.5), Pose2D(2.0, -1.0, 1.0), Pose2D(3.0, -2.0, 2.0)
BENT = Path2D(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]]), Pose2D(2.0, 3.0, 3.0))


@pytest.fixture
def skills() -> Any:
    return scripted_skills("navigate_kitchen")


def after(skills: Any, body: str, entry: str, **entries: Any) -> Any:
    tree = load(skills, body, **entries)
    assert run(skills, tree) == SUCCESS, codes(skills)
    return tree.blackboard.get(entry)


def test_lists_of_goals_are_cut_and_made_longer(skills: Any) -> None:
    few = '<GetNextFewGoals num_goals="2" input_goals="{goals}" output_goals="{out}"/>'
    assert after(skills, few, "out", goals=Goals((A, B, C))) == Goals((A, B))
    assert after(skills, few, "out", goals=Goals((A,))) == Goals((A,))
    more = '<AppendGoalPoseToGoals goal_pose="{c}" input_goals="{goals}" output_goals="{goals}"/>'
    assert after(skills, more, "goals", c=C, goals=Goals((A, B))) == Goals((A, B, C))
    assert after(skills, more, "goals", c=C) == Goals((C,))
    assert run(skills, load(skills, few, goals=Goals(()))) == FAILURE
    assert codes(skills) == ["no_goals"]


def test_paths_are_joined_and_their_poses_face_along_them(skills: Any) -> None:
    other = Path2D(np.array([[2.0, 3.0], [0.0, 3.0]]), Pose2D(0.0, 3.0, 0.0))
    join = '<ConcatenatePaths input_path1="{a}" input_path2="{b}" output_path="{out}"/>'
    joined = after(skills, join, "out", a=BENT, b=other)
    assert (joined.length, joined.goal) == (pytest.approx(7.0), other.goal)
    assert after(skills, join, "out", b=other).length == pytest.approx(2.0)
    pose = '<GetPoseFromPath path="{path}" index="{i}" pose="{pose}"/>'
    assert after(skills, pose, "pose", path=BENT, i=1) == Pose2D(2.0, 0.0, pytest.approx(np.pi / 2))
    assert after(skills, pose, "pose", path=BENT, i=-1) == BENT.goal
    assert run(skills, load(skills, pose, path=BENT, i=3)) == FAILURE


@pytest.mark.parametrize(
    ("place", "result"),
    [((0.5, 0.29, 0.2), SUCCESS), ((0.5, 0.31, 0.2), FAILURE), ((0.5, -0.19, 0.2), SUCCESS),
     ((0.5, -0.21, 0.2), FAILURE), ((2.29, 2.0, 1.6), FAILURE),
     ((1.71, 2.0, 1.6), SUCCESS), ((0.5, 0.0, 1.1), FAILURE)],
)  # fmt: skip
def test_left_and_right_of_a_path_have_bounds_of_their_own(skills: Any, place: tuple[float, ...], result: int) -> None:
    skills.base.path = BENT
    skills.world.base = BasePose(Pose2D(*place), 0.01, 0.01, 0.0)
    bounds = 'max_error_left="0.3" max_error_right="0.2" max_error_heading="1.0"'
    assert run(skills, load(skills, f"<IsWithinPathTrackingBounds {bounds}/>")) == result


def test_time_distance_and_a_paths_age_expire_again_and_again(skills: Any) -> None:
    def asked(tree: Any, times: str) -> list[bool]:
        told = []
        for _ in times:
            told.append(tree.tick_once() == SUCCESS)
            skills.clock.advance(0.4)
        return told

    timer = load(skills, '<TimeExpired seconds="0.7"/>')
    assert asked(timer, "......") == [False, False, True, False, True, False]
    timer.halt()
    assert asked(timer, "...") == [False, False, True]
    age = load(skills, '<PathExpiringTimer path="{path}" seconds="0.7"/>', path=BENT)
    assert asked(age, "...") == [False, False, True]
    age.blackboard.set("path", Path2D(BENT.points, BENT.goal))
    assert asked(age, "...") == [False, False, True]
    travelled = load(skills, '<DistanceTraveled distance="0.5"/>')
    told = []
    for x in (0.0, 0.4, 0.6, 0.9, 1.2, 0.6):
        skills.world.base = BasePose(Pose2D(x, -x, 0.0), 0.01, 0.01, 0.0)
        told.append(travelled.tick_once() == SUCCESS)
    assert told == [False, True, False, True, False, False]


def test_a_base_has_stopped_when_it_has_stood_for_a_while(skills: Any) -> None:
    skills.base.velocity = lambda: Twist2D(0.0, 0.0, 0.005)
    tree = load(skills, '<CheckStopStatus duration_stopped="300"/>')
    assert [tree.tick_once()] == [RUNNING]
    skills.clock.advance(0.31)
    assert tree.tick_once() == SUCCESS
    assert tree.tick_once() == RUNNING
    skills.base.velocity = lambda: Twist2D(0.0, 0.0, -0.02)
    assert tree.tick_once() == FAILURE


def test_poses_where_the_base_would_touch_something_are_not_free(skills: Any) -> None:
    costmap = SimpleNamespace(footprint_clearance=lambda poses: np.where(poses[:, 0] > 1.5, -0.01, 0.01))
    skills.seen_costmap = lambda: costmap
    body = '<RemoveInCollisionGoals input_goals="{goals}" output_goals="{goals}"/>'
    assert after(skills, body, "goals", goals=Goals((B, A, C))) == Goals((A,))
    assert after(skills, body, "goals", goals=Goals(())) == Goals(())
    assert run(skills, load(skills, f'<CheckPoseOccupancy pose="{A.x};{A.y};0"/>')) == SUCCESS
    assert run(skills, load(skills, f'<CheckPoseOccupancy pose="{B.x};{B.y};0"/>')) == FAILURE
    assert codes(skills) == ["goal_blocked"]


def test_a_cancelled_leaf_fails_wherever_in_the_tree_it_runs(skills: Any) -> None:
    skills.base.ends["drive"] = [UNDER_WAY, UNDER_WAY]
    body = '<Parallel failure_count="1"><Fallback><BackUp/><SetBlackboard value="yes" output_key="failed"/></Fallback>'
    tree = load(skills, f"{body}<Sequence><Sleep msec='100'/><CancelSpin/><CancelBackUp/></Sequence></Parallel>")
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("failed") == "yes"
    assert codes(skills) == ["canceled"]


def test_a_nonblocking_sequence_ticks_all_and_a_persistent_one_goes_on_after_a_halt(skills: Any) -> None:
    count = '<Script code="n := n + 1"/>'
    tree = load(skills, f'<NonblockingSequence><Sleep msec="120"/>{count}</NonblockingSequence>', n=0)
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("n") > 2
    body = f'<PersistentSequence current_child_idx="{{at}}">{count}<Sleep msec="60"/>{count}</PersistentSequence>'
    tree = load(skills, body, n=0, at=0)
    assert tree.tick_once() == RUNNING
    tree.halt()
    assert (tree.blackboard.get("n"), tree.blackboard.get("at")) == (1, 1)
    assert run(skills, tree) == SUCCESS
    assert (tree.blackboard.get("n"), tree.blackboard.get("at")) == (2, 0)


def test_a_goal_that_changes_ticks_the_child_and_a_trigger_ticks_it_once(skills: Any) -> None:
    body = '<GoalUpdatedController goal="{goal}"><Script code="n := n + 1"/></GoalUpdatedController>'
    tree = load(skills, f"<Parallel success_count='2'>{body}<Sleep msec='9999'/></Parallel>", n=0, goal=A)
    nested = load(skills, f"<NonblockingSequence>{body}<Sleep msec='9999'/></NonblockingSequence>", n=0, goal=A)
    for goal, n in ((A, 1), (A, 1), (B, 2), (B, 2)):
        nested.blackboard.set("goal", goal)
        assert nested.tick_once() == RUNNING
        assert nested.blackboard.get("n") == n
    assert tree.tick_once() == RUNNING
    once = load(skills, '<Fallback><SingleTrigger><AlwaysFailure/></SingleTrigger><Sleep msec="99"/></Fallback>')
    assert once.tick_once() == RUNNING


def test_docks_by_name_are_not_kept(skills: Any) -> None:
    assert run(skills, load(skills, '<DockRobot dock_id="home"/>')) == FAILURE
    assert run(skills, load(skills, "<UndockRobot/>")) == SUCCESS
    assert codes(skills) == ["no_docks"]
    assert skills.base.asked == [("drive", -0.5)]


LACKING = [name for name in BEHAVIOURS if getattr(BEHAVIOURS.resolve(name), "__module__", "") == lacking.__name__]


@pytest.mark.parametrize("name", LACKING)
def test_what_has_no_counterpart_loads_and_reports_what_it_lacks(skills: Any, name: str) -> None:
    body = f'<{name} enable="false"/>' if name == "ToggleCollisionMonitor" else f"<{name}/>"
    assert run(skills, load(skills, body)) == FAILURE
    assert codes(skills) == ["not_available"]
    assert len(LACKING) == 9


def test_the_collision_monitor_is_on(skills: Any) -> None:
    assert run(skills, load(skills, "<ToggleCollisionMonitor/>")) == SUCCESS
