from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    MotionPlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
from bestman_bt.manipulation.motion_planning.upright import Upright
from bestman_bt.manipulation.trajectory.base import SpeedScale, dense_samples, first_touch
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Pose
from tests.manipulation.motion_planning.joint_worlds import TWO, JointWorld, Kept
from tests.manipulation.table_and_shelf import problems
from tests.rigs.limit_usage import limit_usage


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


@pytest.mark.slow
@pytest.mark.parametrize("number", [*range(4), *(pytest.param(n, marks=pytest.mark.slow) for n in range(4, 10))])
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
    with pytest.raises(MotionPlanningError, match=r"none of 2 timed motions .* at \d\.\d\d s: .*panda_\w+") as refused:
        planner.plan(start, [goal], world, arm, np.random.default_rng(1))
    assert refused.value.code is PlanningErrorCode.TIMED_PATH_INVALID


def test_a_given_path_is_timed_and_checked(world, arm, ready):
    planner = TimedMotionPlanner(RRTConnect(), Toppra())
    slow = planner.follow_path(np.array([ready, ready + 0.1]), world, arm, SpeedScale(0.1, 0.1))
    fast = planner.follow_path(np.array([ready, ready + 0.1]), world, arm, SpeedScale(0.5, 0.5))
    assert slow.duration > 1.5 * fast.duration
    start, goal = problems()[0]
    with pytest.raises(MotionPlanningError, match="the timed motion touches at"):
        planner.follow_path(np.array([start, goal]), world, arm)


class Corner(MotionPlanner):
    """Goes round a corner: timed, the motion rounds it a little. ``asked``: constraints it was given."""

    def __init__(self) -> None:
        self.asked: list[object] = []

    def plan(self, start, goals, world, limits, rng, constraint=None):
        self.asked.append(constraint)
        return MotionPlan(np.array([start, [0.0, 1.0], goals[0]]), 0, 0)


FREE = JointWorld(lambda q: True)
START, GOAL = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
PATH = np.array([START, [0.0, 1.0], GOAL])


@pytest.mark.parametrize(("timed", "kept"), [(1.1, True), (0.8, False)])
def test_a_timed_motion_is_held_against_what_the_constraint_tolerates(timed, kept):
    """The path itself breaks what is asked while planning: what counts for the motion is what is tolerated."""
    planner, constraint = TimedMotionPlanner(Corner(), Toppra(), attempts=2), Kept(0.5, timed)

    def plan():
        return planner.plan(START, [GOAL], FREE, TWO, np.random.default_rng(0), constraint=constraint)

    def follow():
        return planner.follow_path(PATH, FREE, TWO, constraint=constraint)

    if kept:
        assert plan().attempts == 1
        assert follow().duration > 0.0
        assert planner.planner.asked == [constraint]
        return
    for asked, told in ((plan, "the last breaks at"), (follow, "the timed motion breaks at")):
        with pytest.raises(MotionPlanningError, match=rf"{told} \d\.\d\d s: b kept low") as refused:
            asked()
        assert refused.value.code is PlanningErrorCode.TIMED_PATH_INVALID
    assert len(planner.planner.asked) == 2


def test_a_motion_that_breaks_the_constraint_between_its_samples_is_refused():
    """Samples half a second apart: the motion passes the bound and is back before the next one."""
    coarse = TimedMotionPlanner(Corner(), Toppra(rate=2.0))
    path = np.array([START, [0.3, 1.0], GOAL])
    peak = coarse.timing.parametrize(path, TWO)
    highest = max(float(peak.sample(t)[0][1]) for t in np.linspace(0, peak.duration, 2000))
    assert highest > peak.positions[:, 1].max() + 1e-3
    between = (highest + peak.positions[:, 1].max()) / 2
    with pytest.raises(MotionPlanningError, match="breaks at"):
        coarse.follow_path(path, FREE, TWO, constraint=Kept(2.0, between))


@pytest.mark.slow
def test_the_speed_that_is_asked_for_is_that_of_planned_followed_and_recovering_motions():
    planner, slow, rng = TimedMotionPlanner(Corner(), Toppra()), SpeedScale(0.1, 0.1), np.random.default_rng(0)

    class Shallow(JointWorld):
        """In collision below a = 0.05, by as much as that is away."""

        def clearance(self, positions):
            return 0.1 * (float(np.asarray(positions)[0]) - 0.05)

    shallow = Shallow(lambda q: q[0] > 0.05)
    motions = {
        "planned": lambda scale: planner.plan(START, [GOAL], FREE, TWO, rng, scale).trajectory,
        "followed": lambda scale: planner.follow_path(PATH, FREE, TWO, scale),
        "recovering": lambda scale: planner.recover(np.zeros(2), shallow, TWO, rng, scale),
    }
    for motion in motions.values():
        fast, slowed = motion(SpeedScale(1.0, 1.0)), motion(slow)
        assert slowed.duration > 3.0 * fast.duration
        assert np.array_equal(slowed.positions[[0, -1]], fast.positions[[0, -1]])
        assert limit_usage(slowed, TWO).within(0.103)
    with pytest.raises(MotionPlanningError, match="nothing to recover from"):
        planner.recover(np.ones(2), shallow, TWO, rng)


@pytest.mark.parametrize(("tilt", "satisfied", "tolerated"), [(24.9, 1, 1), (25.1, 0, 1), (26.9, 0, 1), (27.1, 0, 0)])
@pytest.mark.parametrize("direction", [0.0, 2.0, 4.0])
def test_upright_is_a_tilt_of_the_object_in_any_direction_and_a_little_more_in_motion(
    kinematics, ready, rng, tilt, satisfied, tolerated, direction
):
    """The object lies askew in the hand: what counts is its own axis."""
    base_from_object = Pose.from_xyz_rpy((0, 0, 0), (0, 0, direction)) @ Pose.from_xyz_rpy(
        (0, 0, 0), (0, np.radians(tilt), 0)
    )
    tool_from_object = Pose(np.zeros(3), (kinematics.tool_pose(ready).inverse() @ base_from_object).quaternion)
    upright = Upright(kinematics, tool_from_object)
    assert upright.satisfied(ready) is bool(satisfied)
    assert upright.tolerated(ready) is bool(tolerated)


def test_zero_attempts_are_refused():
    with pytest.raises(ManipulationError, match="attempts should be at least 1 but is 0"):
        TimedMotionPlanner(RRTConnect(), Toppra(), attempts=0)
