from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning import (
    MotionPlan,
    MotionPlanner,
    PlanningError,
    PlanningErrorCode,
    RRTConnect,
    TimedMotionPlanner,
)
from bestman_bt.manipulation.trajectory import SpeedScale, Toppra, first_touch
from bestman_bt.manipulation.trajectory.collision_check import dense_samples
from tests.manipulation.table_and_shelf import problems


class CarelessAtFirst(MotionPlanner):
    """Answers the straight line ``careless`` times, then plans properly."""

    def __init__(self, careless: int) -> None:
        self.careless = careless
        self.proper = RRTConnect()

    def plan(self, start, goals, world, limits, rng, constraint=None):
        if self.careless:
            self.careless -= 1
            return MotionPlan(np.array([start, goals[0]]), 0, 0)
        return self.proper.plan(start, goals, world, limits, rng, constraint)


@pytest.mark.parametrize("number", range(10))
def test_timed_motions_through_table_and_shelf_are_free_for_pybullet_too(number, world, arm, referee):
    start, goal = problems()[number]
    timed = TimedMotionPlanner(RRTConnect(), Toppra()).plan(start, [goal], world, arm, np.random.default_rng(number))
    trajectory = timed.trajectory
    assert np.allclose(trajectory.positions[[0, -1]], [start, goal], atol=1e-9)
    assert max(referee.depth(q) for _, q in dense_samples(trajectory, 0.02, 0.02)) < 1e-4


def test_a_timed_motion_that_touches_is_planned_anew(world, arm):
    start, goal = problems()[0]
    timed = TimedMotionPlanner(CarelessAtFirst(2), Toppra()).plan(start, [goal], world, arm, np.random.default_rng(1))
    assert timed.attempts == 3
    assert first_touch(timed.trajectory, world) is None


def test_a_planner_that_never_keeps_clear_is_a_failure_that_names_time_and_pair(world, arm):
    start, goal = problems()[0]
    planner = TimedMotionPlanner(CarelessAtFirst(99), Toppra(), attempts=2)
    with pytest.raises(PlanningError, match=r"none of 2 timed motions .* at \d\.\d\d s: .*panda_\w+") as refused:
        planner.plan(start, [goal], world, arm, np.random.default_rng(1))
    assert refused.value.code is PlanningErrorCode.TIMED_PATH_INVALID


def test_a_given_path_is_timed_and_checked(world, arm, ready):
    planner = TimedMotionPlanner(RRTConnect(), Toppra())
    slow = planner.follow_path(np.array([ready, ready + 0.1]), world, arm, SpeedScale(0.1, 0.1))
    fast = planner.follow_path(np.array([ready, ready + 0.1]), world, arm, SpeedScale(0.5, 0.5))
    assert slow.duration > 1.5 * fast.duration
    start, goal = problems()[0]
    with pytest.raises(PlanningError, match="the timed motion touches at"):
        planner.follow_path(np.array([start, goal]), world, arm)


def test_zero_attempts_are_refused():
    with pytest.raises(ManipulationError, match="attempts should be at least 1 but is 0"):
        TimedMotionPlanner(RRTConnect(), Toppra(), attempts=0)
