from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.trajectory import (
    SpeedScale,
    Toppra,
    TrajectoryError,
    limit_usage,
    rescaled,
    rescaled_from,
    stop_along,
)
from tests.manipulation.trajectory.test_toppra import CORNERS


@pytest.fixture(scope="module")
def motion(arm):
    return Toppra().parametrize(CORNERS, arm, SpeedScale(1.0, 1.0))


def off_path(stop, motion):
    dense = np.array([motion.sample(t)[0] for t in np.linspace(0, motion.duration, 6000)])
    return max(float(np.min(np.linalg.norm(dense - q, axis=1))) for q in stop.positions)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95])
def test_a_stop_stays_on_the_path_keeps_the_limits_and_ends_at_rest(motion, arm, share):
    time = share * motion.duration
    stop = stop_along(motion, time, arm)
    usage = limit_usage(stop, arm)
    position, velocity = motion.sample(time)
    assert np.allclose(stop.positions[0], position)
    assert np.allclose(stop.velocities[0], velocity)
    assert np.all(stop.velocities[-1] == 0.0)
    assert usage.within(1.03), usage
    assert off_path(stop, motion) < 2e-3


def test_a_stop_is_as_quick_as_the_acceleration_limits_allow(arm):
    start, goal = np.zeros(7), np.zeros(7)
    start[3] = goal[3] = -1.5
    goal[0] = 2.5
    cruise = Toppra().parametrize([start, goal], arm, SpeedScale(0.5, 0.5))
    speed = cruise.sample(cruise.duration / 2)[1][0]
    stop = stop_along(cruise, cruise.duration / 2, arm)
    assert stop.duration == pytest.approx(speed / arm.acceleration[0], rel=0.1)


def test_a_motion_that_is_over_stays_where_it_is(motion, arm):
    stop = stop_along(motion, motion.duration + 1.0, arm)
    assert stop.duration == 0.0
    assert np.array_equal(stop.positions[0], motion.positions[-1])


def test_a_slowed_motion_visits_the_same_positions(motion):
    slow = rescaled(motion, 0.5)
    assert slow.duration == pytest.approx(2 * motion.duration)
    for time in np.linspace(0, motion.duration, 50):
        assert np.allclose(slow.sample(2 * time)[0], motion.sample(time)[0], atol=1e-9)
        assert np.allclose(2 * slow.sample(2 * time)[1], motion.sample(time)[1], atol=1e-6)


@pytest.mark.parametrize("factor", [0.3, 1.5])
def test_a_running_motion_changes_its_speed_smoothly_on_its_path(arm, factor):
    motion = Toppra().parametrize(CORNERS, arm, SpeedScale(0.5, 0.35))
    time = 0.4 * motion.duration
    rest = rescaled_from(motion, time, factor, arm)
    usage = limit_usage(rest, arm)
    assert np.allclose(rest.velocities[0], motion.sample(time)[1])
    assert np.allclose(rest.positions[-1], motion.positions[-1])
    assert rest.duration == pytest.approx(0.6 * motion.duration / factor, rel=0.15)
    assert usage.within(1.03), usage
    assert off_path(rest, motion) < 2e-3


def test_a_speed_that_the_limits_forbid_is_refused_with_what_they_allow(motion, arm):
    with pytest.raises(TrajectoryError, match=r"allow this motion a speed factor of 1\.\d+ but 2\.0 was asked"):
        rescaled_from(motion, 0.1, 2.0, arm)


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_that_is_not_above_zero_is_refused(motion, factor):
    with pytest.raises(ManipulationError, match="speed factor should be above 0"):
        rescaled(motion, factor)


def test_a_time_that_is_not_finite_is_refused(motion, arm):
    with pytest.raises(ManipulationError, match="time in a motion should be finite"):
        stop_along(motion, float("nan"), arm)
