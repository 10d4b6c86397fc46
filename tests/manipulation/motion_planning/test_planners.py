from __future__ import annotations

import hashlib
import pickle
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import MotionPlanner, MotionPlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.motion_planning.ompl_planners import AORRTC, BIT_STAR, KPIECE, RRT_STAR
from bestman_bt.manipulation.motion_planning.portfolio import Portfolio
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.registry import ALGORITHMS
from examples.plugins.lazy_prm import PRM
from hal.pybullet.package import pybullet
from tests.manipulation.motion_planning.joint_worlds import PortfolioOf
from tests.manipulation.table_and_shelf import problems

SEARCHING = (
    RRTConnect(),
    RRT_STAR,
    BIT_STAR,
    AORRTC,
    PRM(),
    KPIECE,
)
ALL = (*SEARCHING, Portfolio())
SHELF = 6
"""A problem of the ten whose straight way is blocked and which all planners solve in tens of milliseconds."""


@pytest.fixture(scope="module", params=ALL, ids=[*(planner.name for planner in SEARCHING), "Portfolio"])
def planner(request) -> MotionPlanner:
    return request.param


@pytest.fixture(scope="module")
def plan(planner, world, arm):
    start, goal = problems()[SHELF]
    return planner.plan(start, [goal], world, arm, np.random.default_rng(1))


@pytest.mark.quick_cases(2)
def test_a_shelf_problem_is_solved_free_of_touch_for_pybullet_too(plan, referee, arm):
    start, goal = problems()[SHELF]
    assert np.array_equal(plan.path[[0, -1]], [start, goal])
    assert len(plan.path) > 2
    assert np.all((plan.path >= arm.lower - 1e-9) & (plan.path <= arm.upper + 1e-9))
    assert max(referee.depth(q) for q in dense_points(plan.path, 0.01)) < 1e-4


@pytest.mark.quick_cases(2)
def test_the_same_generator_gives_the_same_plan(planner, plan, world, arm):
    start, goal = problems()[SHELF]
    again = planner.plan(start, [goal], world, arm, np.random.default_rng(1))
    assert np.array_equal(again.path, plan.path)


def test_bad_requests_are_refused_by_name(planner, world, arm, ready, rng):
    start, goal = problems()[SHELF]
    in_table = np.array([0.0, 1.2, 0.0, -1.2, 0.0, 2.0, 0.0])
    assert not world.is_free(in_table)
    with pytest.raises(MotionPlanningError, match="the start is in collision: .* with ") as refused:
        planner.plan(in_table, [goal], world, arm, rng)
    assert refused.value.code is PlanningErrorCode.START_IN_COLLISION
    with pytest.raises(MotionPlanningError, match="goal 0 is in collision: .* with ") as refused:
        planner.plan(start, [in_table], world, arm, rng)
    assert refused.value.code is PlanningErrorCode.GOAL_IN_COLLISION
    with pytest.raises(ManipulationError, match="start should be finite"):
        planner.plan(start * np.nan, [goal], world, arm, rng)
    with pytest.raises(ManipulationError, match=r"goal 0 should be 7 joint positions but has shape \(6,\)"):
        planner.plan(start, [goal[:6]], world, arm, rng)
    with pytest.raises(ManipulationError, match="goals should hold at least one goal"):
        planner.plan(start, [], world, arm, rng)


@pytest.mark.parametrize("planner", SEARCHING, ids=lambda planner: planner.name)
def test_a_search_that_ends_without_an_exact_path_is_a_failure(planner, world, arm, rng):
    start, goal = problems()[5]
    hurried = replace(planner, max_checks=30, attempts=1)
    message = f"{planner.name} found no path to any of 1 goals .*; on the straight way .* and .* collide"
    with pytest.raises(MotionPlanningError, match=message) as refused:
        hurried.plan(start, [goal], world, arm, rng)
    assert refused.value.code is PlanningErrorCode.NO_PATH


def test_a_wall_limit_aborts_with_an_error(world, arm, rng):
    start, goal = problems()[5]
    with pytest.raises(MotionPlanningError, match="planning was aborted after 1e-06 s and") as aborted:
        RRTConnect(wall_limit=1e-6).plan(start, [goal], world, arm, rng)
    assert aborted.value.code is PlanningErrorCode.TIMEOUT


@pytest.mark.slow
def test_planning_never_touches_a_simulated_world(world, arm, referee):
    """The whole state of the simulator, contacts and joints, before and after all planners have planned in it."""

    def state() -> str:
        client = referee.client
        bodies = [pybullet.getBodyUniqueId(i, physicsClientId=client) for i in range(pybullet.getNumBodies(client))]
        poses = [pybullet.getBasePositionAndOrientation(body, physicsClientId=client) for body in bodies]
        joints = [
            pybullet.getJointState(body, joint, physicsClientId=client)
            for body in bodies
            for joint in range(pybullet.getNumJoints(body, physicsClientId=client))
        ]
        return hashlib.sha256(pickle.dumps((bodies, poses, joints))).hexdigest()

    start, goal = problems()[SHELF]
    referee.place(start)
    before = state()
    for planner in ALL:
        planner.plan(start, [goal], world, arm, np.random.default_rng(1))
    assert state() == before
    referee.place(goal)
    assert state() != before


def test_every_planner_has_a_registered_name():
    registered = [ALGORITHMS.resolve(name) for name in ALGORITHMS if name.startswith("motion_planning/")]
    assert all(planner in registered or type(planner) in (*registered, PRM) for planner in ALL)


@pytest.mark.slow
def test_a_portfolio_of_the_best_is_no_longer_than_any_of_its_planners(world, arm):
    start, goal = problems()[SHELF]
    both = Portfolio(planners=("rrt_connect", "kpiece"), take="best")
    rngs = np.random.default_rng(3).spawn(2)
    lengths = [
        p.plan(start, [goal], world, arm, rng).length for p, rng in zip((RRTConnect(), KPIECE), rngs, strict=True)
    ]
    assert both.plan(start, [goal], world, arm, np.random.default_rng(3)).length == min(lengths)


def test_a_portfolio_goes_on_to_the_next_planner_and_tells_of_all_failures(world, arm, rng):
    start, goal = problems()[5]
    hopeless = RRTConnect(max_checks=30, attempts=1)
    plan = PortfolioOf(members=(hopeless, KPIECE)).plan(start, [goal], world, arm, rng)
    assert np.array_equal(plan.path[-1], goal)
    with pytest.raises(MotionPlanningError, match="RRTConnect found no path .*; RRTConnect found no path"):
        PortfolioOf(members=(hopeless, hopeless)).plan(start, [goal], world, arm, rng)
