"""Timing, stopping and measuring motions of two joints, whose numbers can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.trajectory.base import SpeedScale, TrajectoryError, dense_samples, first_touch
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import JointTrajectory
from tests.manipulation.motion_planning.joint_worlds import TWO, JointWorld
from tests.rigs.limit_usage import limit_usage

FULL = SpeedScale(1.0, 1.0)
NAMES = TWO.joint_names


def motion(times, positions, velocities=None) -> JointTrajectory:
    positions = np.array(positions, dtype=float)
    return JointTrajectory(
        NAMES, np.array(times, dtype=float), positions, np.zeros_like(positions) if velocities is None else velocities
    )


def uniform(speed: float, duration: float = 1.0, joint: int = 0, samples: int = 51) -> JointTrajectory:
    """One joint at a constant speed through 0, as a part of a motion."""
    times = np.linspace(0.0, duration, samples)
    positions, velocities = np.zeros((2, samples, 2))
    positions[:, joint], velocities[:, joint] = speed * (times - duration / 2), speed
    return motion(times, positions, velocities)


SPARSE = motion([0.0, 0.4, 1.4], [[0.0, 0.0], [0.3, 0.0], [0.3, 1.0]])
"""Two jumps from rest to rest between three samples."""


@pytest.mark.parametrize("time", [0.0, 0.2, 0.4, 0.9, 1.4])
def test_a_touch_anywhere_is_found_with_its_time(time: float) -> None:
    place = SPARSE.sample(time)[0]
    touch = first_touch(SPARSE, JointWorld(lambda q: np.linalg.norm(q - place) > 0.008))
    assert touch is not None
    assert touch.time == pytest.approx(time, abs=0.12)
    assert touch.pairs == (("arm", "wall"),)
    assert first_touch(SPARSE, JointWorld(lambda q: np.linalg.norm(q - place + 0.05) > 0.008)) is None


@pytest.mark.parametrize(("max_time", "max_step", "count"), [(10.0, 0.1, 14), (0.1, 10.0, 15), (10.0, 10.0, 3)])
def test_samples_are_dense_in_time_and_in_space_each_by_itself(max_time: float, max_step: float, count: int) -> None:
    samples = list(dense_samples(SPARSE, max_time, max_step))
    assert len(samples) == count
    for time, positions in samples:
        assert positions == pytest.approx(SPARSE.sample(time)[0])
    assert np.diff([time for time, _ in samples]).min() > 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("joint", "bound"), [(0, 2.0), (1, 1.5)])
def test_how_far_a_joint_leaves_its_range_is_reported_on_either_side(sign: float, joint: int, bound: float) -> None:
    beyond = np.zeros((3, 2))
    limit = TWO.upper[joint] if sign > 0 else TWO.lower[joint]
    beyond[1, joint] = limit + 0.07 * sign
    usage = limit_usage(motion([0.0, 5.0, 10.0], beyond), TWO)
    assert usage.position == pytest.approx(0.07)
    assert not usage.within()
    assert usage.within(position_slack=0.08)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speed_counts_between_the_samples_in_either_direction(sign: float) -> None:
    """From rest to rest in one cubic: 1.5 times the mean speed, half-way."""
    usage = limit_usage(motion([0.0, 1.0], [[0.0, 0.0], [0.4 * sign, 0.0]]), TWO)
    assert usage.velocity == pytest.approx(0.6)
    assert limit_usage(uniform(0.5 * sign, joint=1), TWO).velocity == pytest.approx(0.25)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_acceleration_and_jerk_are_shares_of_each_joints_limit_in_either_direction(sign: float) -> None:
    """b at v = t² s: at most 2 rad/s² of 5 at the end, and 2 rad/s³ throughout."""
    times = np.linspace(0.0, 1.0, 101)
    positions, velocities = np.zeros((2, 101, 2))
    positions[:, 1], velocities[:, 1] = sign * times**3 / 3, sign * times**2
    usage = limit_usage(motion(times, positions, velocities), TWO, [1.0, 4.0])
    assert usage.acceleration == pytest.approx(0.4, abs=0.003)
    assert usage.jerk == pytest.approx(0.5, abs=1e-6)
    assert usage.within()
    assert not limit_usage(motion(times, positions, velocities), TWO, [1.0, 1.5]).within()
    with pytest.raises(ManipulationError, match="jerk should be 2 limits above 0"):
        limit_usage(uniform(0.1), TWO, [1.0])


PATHS = [np.random.default_rng(seed).uniform(TWO.lower * 0.9, TWO.upper * 0.9, (5, 2)) for seed in range(4)]


@pytest.mark.parametrize(
    ("place", "accepted"), [([2.009, 0], 1), ([2.011, 0], 0), ([-2.011, 0], 0), ([0, -1.011], 0), ([0, -1.009], 1)]
)
def test_a_timed_path_may_begin_a_little_outside_the_limits_on_either_side(place: list[float], accepted: int) -> None:
    path = np.array([place, [0.0, 0.0]])
    if accepted:
        assert np.array_equal(Toppra().parametrize(path, TWO).positions[0], place)
    else:
        with pytest.raises(TrajectoryError, match=r"the path takes [ab] to -?\d\.\d+, allowed"):
            Toppra().parametrize(path, TWO)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [SpeedScale(1.0, 0.2), pytest.param(SpeedScale(0.2, 1.0), marks=pytest.mark.slow)])
@pytest.mark.parametrize("path", [PATHS[0], pytest.param(PATHS[1], marks=pytest.mark.slow)], ids=range(2))
def test_speed_and_acceleration_are_scaled_each_by_itself_in_both_directions(
    scale: SpeedScale, path: np.ndarray
) -> None:
    """On a coarse grid toppra overshoots: the motion is slowed by what its samples show."""
    for one in (path, path[::-1]):
        timed = Toppra(min_grid=20, grid_per_waypoint=1).parametrize(one, TWO, scale)
        usage = limit_usage(timed, TWO)
        assert usage.velocity <= 1.03 * scale.velocity
        assert usage.acceleration <= 1.03 * scale.acceleration
        assert max(usage.velocity / scale.velocity, usage.acceleration / scale.acceleration) > 0.9
        assert np.array_equal(timed.positions[[0, -1]], one[[0, -1]])
        at_rest = [timed.sample(t)[1] for t in (0.0, timed.duration - 1e-9)]
        assert np.allclose(at_rest, 0.0, atol=1e-6)


def test_a_path_ends_exactly_where_it_was_told_however_near_the_last_two_points() -> None:
    path = np.array([[0.0, 0.0], [0.5, 0.5], [0.5 + 1e-7, 0.5]])
    assert np.array_equal(Toppra().parametrize(path, TWO).positions[-1], path[-1])


@pytest.mark.parametrize("name", ["velocity", "acceleration"])
@pytest.mark.parametrize("value", [0.0, -0.1, 1.001, float("nan")])
def test_shares_of_limits_are_above_nothing_and_at_most_all(name: str, value: float) -> None:
    with pytest.raises(TrajectoryError, match=f"SpeedScale {name} should be above 0 and at most 1"):
        SpeedScale(**{name: value})


RUCKIG = RuckigStateToState(straight=False)


@pytest.mark.parametrize("scale", [SpeedScale(1.0, 0.2), SpeedScale(0.2, 1.0), FULL])
@pytest.mark.parametrize("straight", [True, False])
def test_jerk_limited_motions_keep_the_scaled_limits_and_use_one_of_them(scale: SpeedScale, straight: bool) -> None:
    timing = RuckigStateToState(straight=straight)
    jerk = timing.jerk_limits(TWO, scale)
    assert jerk == pytest.approx(TWO.acceleration * scale.acceleration / 0.1)
    for start, goal in ((PATHS[0][0], PATHS[0][1]), (PATHS[0][1], PATHS[0][0])):
        usage = limit_usage(timing.plan(start, goal, TWO, scale), TWO, jerk)
        assert usage.velocity <= 1.001 * scale.velocity
        assert usage.acceleration <= 1.001 * scale.acceleration
        assert 0.9 < usage.jerk <= 1.03


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("joint", [0, 1])
def test_speeds_beyond_the_scaled_limit_are_refused_by_joint_end_and_sign(joint: int, end: str, sign: float) -> None:
    speed = np.zeros(2)
    allowed = 0.5 * TWO.velocity[joint]
    speed[joint] = sign * 1.01 * allowed
    with pytest.raises(
        TrajectoryError, match=rf"{end} velocity of {NAMES[joint]} should be within {allowed:.3f} but is"
    ):
        RUCKIG.plan(np.zeros(2), np.full(2, 0.2), TWO, SpeedScale(0.5, 0.5), **{f"{end}_velocity": speed})
    speed[joint] = sign * 0.99 * allowed
    moved = RUCKIG.plan(np.zeros(2), np.full(2, 0.2), TWO, SpeedScale(0.5, 0.5), **{f"{end}_velocity": speed})
    assert moved.velocities[0 if end == "start" else -1] == pytest.approx(speed, abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motion_that_swings_out_of_the_range_on_either_side_is_refused(sign: float) -> None:
    start = np.array([1.95 * sign, 0.0])
    with pytest.raises(TrajectoryError, match=r"the motion takes a to"):
        RUCKIG.plan(start, np.zeros(2), TWO, FULL, start_velocity=[0.8 * sign, 0.0])


def test_an_arm_that_moves_through_its_goal_comes_back_to_it() -> None:
    back = RUCKIG.plan(np.zeros(2), np.zeros(2), TWO, FULL, start_velocity=[0.5, 0.0])
    assert back.duration > 0.5
    assert back.positions[:, 0].max() > 0.05
    assert np.allclose(back.positions[-1], 0.0, atol=1e-9)


def test_between_its_samples_a_jerk_limited_motion_is_exactly_cubic() -> None:
    """Also where it brakes first, since it began too fast for what is left."""
    fine, coarse = (RuckigStateToState(rate=rate, straight=False) for rate in (1000.0, 5.0))
    for velocity in ([0.9, 0.0], [-0.9, 1.9]):
        plans = [timing.plan(np.zeros(2), np.array([0.5, 0.1]), TWO, FULL, velocity) for timing in (fine, coarse)]
        for time in np.linspace(0.0, plans[0].duration, 200):
            assert np.allclose(plans[1].sample(time)[0], plans[0].sample(time)[0], atol=2e-5)
