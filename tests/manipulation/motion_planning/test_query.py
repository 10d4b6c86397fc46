"""What is refused before any search, to the last milliradian, and which goal a path has reached."""

from __future__ import annotations

import re

import numpy as np
import pytest

from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    MotionPlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points, halving_order
from bestman_bt.manipulation.motion_planning.ompl_planners import KPIECE
from bestman_bt.manipulation.motion_planning.portfolio import Portfolio
from bestman_bt.manipulation.motion_planning.query import check_query
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from examples.plugins.lazy_prm import PRM
from tests.manipulation.motion_planning.joint_worlds import TWO, JointWorld, Kept, PortfolioOf

FREE = JointWorld(lambda q: True)
START, GOAL = np.array([0.5, 0.0]), np.array([-0.5, 0.2])


def query(start=START, goals=(GOAL,), world=FREE, constraint=None):
    return check_query(start, goals, world, TWO, constraint, 0.01)


@pytest.mark.parametrize(
    ("start", "accepted"), [([2.009, 0], True), ([2.011, 0], False), ([0, -1.009], True), ([0, -1.011], False)]
)
def test_a_start_may_be_outside_its_limits_by_the_tolerance_alone(start, accepted):
    if accepted:
        found = query(np.array(start))
        assert np.array_equal(found.lower, np.minimum(TWO.lower, start))
        assert np.array_equal(found.upper, np.maximum(TWO.upper, start))
        return
    with pytest.raises(MotionPlanningError, match="the start is outside its limits") as refused:
        query(np.array(start))
    assert refused.value.code is PlanningErrorCode.START_OUT_OF_LIMITS


@pytest.mark.parametrize(("goal", "accepted"), [([2.0, 0], True), ([2.001, 0], False), ([0, -1.001], False)])
def test_a_goal_keeps_the_limits(goal, accepted):
    if accepted:
        assert query(goals=[np.array(goal)]).indices == (0,)
        return
    with pytest.raises(MotionPlanningError, match="goal 0 is outside its limits") as refused:
        query(goals=[np.array(goal)])
    assert refused.value.code is PlanningErrorCode.GOAL_OUT_OF_LIMITS


def test_a_goal_against_the_constraint_is_left_out_or_refused():
    low = Kept(0.3, 0.3)
    high = np.array([0.0, 0.4])
    found = query(goals=[high, GOAL], constraint=low)
    assert found.indices == (1,)
    assert found.index_of(GOAL) == 1
    with pytest.raises(MotionPlanningError, match="goal 0 violates: b kept low") as refused:
        query(goals=[high], constraint=low)
    assert refused.value.code is PlanningErrorCode.GOAL_VIOLATES_CONSTRAINT


WALL = JointWorld(lambda q: abs(q[0]) > 0.1 or q[1] > 0.8)
"""Between a = -0.1 and 0.1 there is a way above b = 0.8 alone."""


@pytest.mark.parametrize("planner", [RRTConnect(), KPIECE, PRM(samples=300)])
def test_paths_keep_the_limits_the_world_and_the_constraint(planner):
    goals = [np.array([3.0, 0.0]), np.array([-1.5, 1.4]), np.array([-1.0, -0.5])]
    ceiling = Kept(1.3, 1.3)
    plan = planner.plan(np.array([1.0, -0.9]), goals, WALL, TWO, np.random.default_rng(1), ceiling)
    assert plan.goal_index == 2
    assert np.array_equal(plan.path[-1], goals[2])
    assert all(WALL.is_free(q) and ceiling.satisfied(q) for q in dense_points(plan.path, 0.01))
    assert np.all((plan.path >= TWO.lower) & (plan.path <= TWO.upper))


def test_a_constraint_that_leaves_no_way_is_no_path():
    hurried = RRTConnect(max_checks=600, attempts=2)
    with pytest.raises(MotionPlanningError) as refused:
        hurried.plan(START, [np.array([-0.5, -0.2])], WALL, TWO, np.random.default_rng(1), Kept(0.7, 0.7))
    assert refused.value.code is PlanningErrorCode.NO_PATH


def test_the_nearest_goal_with_a_straight_way_is_taken_and_named():
    plan = RRTConnect().plan(
        START, [np.array([1.9, 0.0]), GOAL, np.array([0.6, 0.1])], WALL, TWO, np.random.default_rng(0)
    )
    assert plan.goal_index == 2
    assert len(plan.path) == 2


def test_a_straight_way_is_checked_finely():
    """A post of 0.02 rad between the coarse points, 0.03 rad apart."""
    post = JointWorld(lambda q: not 0.005 < q[0] < 0.025 or q[1] > 0.5)
    plan = RRTConnect().plan(START, [np.array([-0.52, 0.0])], post, TWO, np.random.default_rng(0))
    assert len(plan.path) > 2
    assert all(post.is_free(q) for q in dense_points(plan.path, 0.005))


def test_a_search_is_bounded_by_its_checks_and_every_attempt_is_made():
    closed = JointWorld(lambda q: abs(q[0]) > 0.1)
    for attempts, most in ((1, 700), (3, 2000)):
        closed.asked.clear()
        with pytest.raises(MotionPlanningError):
            RRTConnect(max_checks=500, attempts=attempts).plan(START, [GOAL], closed, TWO, np.random.default_rng(0))
        assert 0.6 * most < len(closed.asked) < most


class Scripted(MotionPlanner):
    """Answers with a path through ``via``, or refuses with a code; ``asked``: the arguments of each question."""

    def __init__(self, answer) -> None:
        self.answer, self.asked = answer, []

    def plan(self, start, goals, world, limits, rng, constraint=None):
        self.asked.append((start, goals, world, limits, constraint))
        if isinstance(self.answer, PlanningErrorCode):
            raise MotionPlanningError(self.answer, f"refused: {self.answer}")
        return MotionPlan(np.array([start, *self.answer, goals[0]]), 0, 1)


LONG, SHORT = [np.array([0.0, 1.0])], []


def test_a_portfolio_goes_on_after_no_path_and_after_time_is_up_but_not_after_a_refusal():
    for code in (PlanningErrorCode.NO_PATH, PlanningErrorCode.TIMEOUT):
        second = Scripted(SHORT)
        plan = PortfolioOf(members=(Scripted(code), second)).plan(START, [GOAL], FREE, TWO, np.random.default_rng(0))
        assert len(plan.path) == 2
        assert len(second.asked) == 1
    never = Scripted(SHORT)
    with pytest.raises(MotionPlanningError) as refused:
        PortfolioOf(members=(Scripted(PlanningErrorCode.START_IN_COLLISION), never)).plan(
            START, [GOAL], FREE, TWO, np.random.default_rng(0)
        )
    assert refused.value.code is PlanningErrorCode.START_IN_COLLISION
    assert never.asked == []


def test_a_portfolio_asks_the_next_only_as_it_takes_the_best_and_hands_on_the_constraint():
    kept = Kept(1.0, 1.0)
    first, second = Scripted(LONG), Scripted(SHORT)
    plan = PortfolioOf(members=(first, second)).plan(START, [GOAL], FREE, TWO, np.random.default_rng(0), kept)
    assert len(plan.path) == 3
    assert second.asked == []
    assert first.asked[0][-1] is kept
    best = PortfolioOf(take="best", members=(first, second))
    assert len(best.plan(START, [GOAL], FREE, TWO, np.random.default_rng(0), kept).path) == 2


def test_all_but_the_last_of_a_portfolio_are_impatient():
    closed = JointWorld(lambda q: abs(q[0]) > 0.1)
    impatient = Portfolio(planners=("rrt_connect", "kpiece"), impatience=200)
    with pytest.raises(MotionPlanningError) as refused:
        impatient.plan(START, [GOAL], closed, TWO, np.random.default_rng(0))
    first, last = (int(count) for count in re.findall(r"after (\d+) collision checks", str(refused.value)))
    assert first < 300
    assert last > 3000


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 100])
def test_every_inner_point_of_an_edge_is_asked_once_the_middle_first(count):
    order = halving_order(count)
    assert sorted(order) == [i / count for i in range(1, count)]
    assert not order or order[0] == (count // 2) / count


def test_dense_points_are_never_farther_apart_than_asked():
    points = np.array(list(dense_points(np.array([[0.0], [0.25], [0.26]]), 0.1)))
    assert np.diff(points[:, 0]).max() <= 0.1
    assert len(points) == 5
