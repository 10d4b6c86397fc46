from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.upright import Upright
from bestman_bt.messages import Pose
from tests.manipulation.table_and_shelf import problems

QUICK = RRTConnect(max_checks=1500, attempts=1)


class WallAcrossJointOne(CollisionWorld):
    """Positions whose first joint is within 0.1 rad of zero collide; nothing passes. Answers as numpy does."""

    def __init__(self, joint_names: tuple[str, ...]) -> None:
        self._joint_names = joint_names
        self.questions = 0

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self._joint_names

    def is_free(self, positions):
        self.questions += 1
        return np.abs(np.asarray(positions)[0]) > 0.1

    def colliding_pairs(self, positions):
        return () if self.is_free(positions) else (("link1", "wall"),)

    def distance(self, positions):
        return float(np.abs(np.asarray(positions)[0]) - 0.1)


class GateAcrossJointOne(WallAcrossJointOne):
    """The wall with an opening where the second joint is above 0.5 rad."""

    def is_free(self, positions):
        return super().is_free(positions) | (np.asarray(positions)[1] > 0.5)


@pytest.fixture
def wall(arm):
    return WallAcrossJointOne(arm.joint_names)


def test_a_checker_that_answers_with_numpy_booleans_works(arm, ready, rng):
    gate = GateAcrossJointOne(arm.joint_names)
    left, right = ready + np.eye(7)[0], ready - np.eye(7)[0]
    assert isinstance(gate.is_free(left), np.bool_)
    plan = RRTConnect().plan(left, [right], gate, arm, rng)
    assert len(plan.path) > 2
    assert np.array_equal(plan.path[[0, -1]], [left, right])
    assert all(gate.is_free(q) for q in dense_points(plan.path, 0.01))
    assert np.all((plan.path >= arm.lower) & (plan.path <= arm.upper))


def test_an_unsolvable_problem_is_a_failure_and_not_an_approximate_path(arm, ready, rng, wall):
    with pytest.raises(MotionPlanningError, match="no path to any of 1 goals") as refused:
        QUICK.plan(ready + np.eye(7)[0], [ready - np.eye(7)[0]], wall, arm, rng)
    assert refused.value.code is PlanningErrorCode.NO_PATH
    assert wall.questions < 4000


def test_plans_depend_on_the_generator_alone_not_on_plans_made_before(arm, world):
    planner = RRTConnect()
    (s0, g0), (s1, g1) = problems()[0], problems()[7]
    first = planner.plan(s0, [g0], world, arm, np.random.default_rng(1)).path
    planner.plan(s1, [g1], world, arm, np.random.default_rng(2))
    again = planner.plan(s0, [g0], world, arm, np.random.default_rng(1)).path
    other = RRTConnect().plan(s0, [g0], world, arm, np.random.default_rng(3)).path
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_free_straight_way_is_taken_without_a_search(arm, ready, rng, wall):
    plan = QUICK.plan(ready + np.eye(7)[0], [ready + 1.5 * np.eye(7)[0]], wall, arm, rng)
    assert len(plan.path) == 2
    assert plan.length == pytest.approx(0.5)


def test_shortcuts_make_the_path_shorter(arm, world):
    without = RRTConnect(shortcut_attempts=0)
    long, short = (
        sum(planner.plan(start, [goal], world, arm, np.random.default_rng(1)).length for start, goal in problems()[1:4])
        for planner in (without, RRTConnect())
    )
    assert short < 0.95 * long


def test_of_several_goals_one_that_can_be_reached_is_chosen(arm, ready, rng, wall):
    inside = ready.copy()
    behind, reachable = ready - np.eye(7)[0], ready + 2 * np.eye(7)[0]
    plan = QUICK.plan(ready + np.eye(7)[0], [inside, behind, reachable], wall, arm, rng)
    assert plan.goal_index == 2
    assert np.array_equal(plan.path[-1], reachable)


def test_a_start_or_goal_in_collision_is_refused_with_the_pair(arm, ready, rng, wall):
    side = ready + np.eye(7)[0]
    with pytest.raises(MotionPlanningError, match="the start is in collision: link1 with wall") as start:
        QUICK.plan(ready, [side], wall, arm, rng)
    with pytest.raises(MotionPlanningError, match="goal 0 is in collision: link1 with wall") as goal:
        QUICK.plan(side, [ready], wall, arm, rng)
    assert start.value.code is PlanningErrorCode.START_IN_COLLISION
    assert goal.value.code is PlanningErrorCode.GOAL_IN_COLLISION


def test_limits_are_kept_but_a_start_that_sags_a_little_is_accepted(arm, ready, rng, wall):
    side = ready + np.eye(7)[0]
    sagging, outside = side.copy(), side.copy()
    sagging[3], outside[3] = arm.upper[3] + 0.005, arm.upper[3] + 0.05
    assert np.array_equal(QUICK.plan(sagging, [side], wall, arm, rng).path[0], sagging)
    with pytest.raises(MotionPlanningError, match=r"panda_joint4 at -0.0198, allowed -3.0718 to -0.0698") as start:
        QUICK.plan(outside, [side], wall, arm, rng)
    with pytest.raises(MotionPlanningError, match="goal 0 is outside its limits: panda_joint4") as goal:
        QUICK.plan(side, [outside], wall, arm, rng)
    assert start.value.code is PlanningErrorCode.START_OUT_OF_LIMITS
    assert goal.value.code is PlanningErrorCode.GOAL_OUT_OF_LIMITS


def test_bad_requests_are_refused_by_name(arm, ready, rng, wall):
    with pytest.raises(ManipulationError, match="goals should hold at least one goal"):
        QUICK.plan(ready, [], wall, arm, rng)
    with pytest.raises(ManipulationError, match=r"goal 0 should be 7 joint positions but has shape \(6,\)"):
        QUICK.plan(ready, [ready[:6]], wall, arm, rng)
    with pytest.raises(ManipulationError, match="start should be finite"):
        QUICK.plan(ready * np.nan, [ready], wall, arm, rng)
    with pytest.raises(ManipulationError, match="the collision world moves a, b but the limits are for panda_joint1"):
        QUICK.plan(ready, [ready], WallAcrossJointOne(("a", "b")), arm, rng)


def test_an_error_in_the_checker_reaches_the_caller(arm, ready, rng):
    class Broken(GateAcrossJointOne):
        def is_free(self, positions):
            if self.questions > 200:
                raise RuntimeError("sensor lost")
            return super().is_free(positions)

    with pytest.raises(RuntimeError, match="sensor lost"):
        RRTConnect().plan(ready + np.eye(7)[0], [ready - np.eye(7)[0]], Broken(arm.joint_names), arm, rng)


def test_what_the_hand_holds_stays_upright(arm, kinematics, rng):
    """Two upright postures between which the straight way tilts the hand."""
    down = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (np.pi, 0.0, 0.0))
    free = WallAcrossJointOne(arm.joint_names)
    free.is_free = lambda positions: True
    start = kinematics.solve(
        Pose.from_xyz_rpy((0.5, 0.3, 0.6), (np.pi, 0, 0)), np.array([0, -0.5, 0, -2.2, 0, 1.8, 0.785]), rng
    ).best
    goal = kinematics.solve(
        Pose.from_xyz_rpy((0.4, -0.4, 0.3), (np.pi, 0, 2.0)), np.array([0.5, 1.0, -2.0, -2.0, 1.5, 2.0, 0]), rng
    ).best

    def tilts(path):
        return [(kinematics.tool_pose(q) @ down).tilt for q in dense_points(path, 0.01)]

    upright = Upright(kinematics, down)
    plan = RRTConnect().plan(start, [goal], free, arm, rng, constraint=upright)
    assert max(tilts(RRTConnect().plan(start, [goal], free, arm, rng).path)) > np.radians(27)
    assert max(tilts(plan.path)) <= np.radians(25.0) + 1e-6
    with pytest.raises(
        MotionPlanningError, match="the start violates: the held object upright within 25 degrees"
    ) as refused:
        RRTConnect().plan(start, [goal], free, arm, rng, constraint=Upright(kinematics, Pose()))
    assert refused.value.code is PlanningErrorCode.START_VIOLATES_CONSTRAINT
