from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.trajectory.base import SpeedScale, TrajectoryError
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState
from tests.rigs.limit_usage import limit_usage

FULL = SpeedScale(1.0, 1.0)


@pytest.mark.slow
def test_velocity_acceleration_and_jerk_keep_their_limits_on_dense_samples(arm, rng):
    timing = RuckigStateToState(straight=False)
    for _ in range(20):
        start, goal = rng.uniform(arm.lower + 0.6, arm.upper - 0.6, (2, 7))
        speed = rng.uniform(-0.3, 0.3, 7)
        motion = timing.plan(start, goal, arm, FULL, speed)
        usage = limit_usage(motion, arm, timing.jerk_limits(arm, FULL))
        assert usage.within(1.03), usage
        assert max(usage.velocity, usage.acceleration, usage.jerk) > 0.9
        assert np.allclose(motion.positions[[0, -1]], [start, goal], atol=1e-6)
        assert np.allclose(motion.velocities[0], speed, atol=1e-6)
        assert np.allclose(motion.velocities[-1], 0.0, atol=1e-6)


def test_from_rest_to_rest_the_motion_is_a_straight_line(arm, ready, rng):
    goal = ready + rng.uniform(-0.5, 0.5, 7)
    motion = RuckigStateToState().plan(ready, goal, arm)
    direction = (goal - ready) / np.linalg.norm(goal - ready)
    away = motion.positions - ready
    assert np.abs(away - np.outer(away @ direction, direction)).max() < 1e-6


def test_a_state_that_is_reached_already_gives_one_sample(arm, ready):
    assert RuckigStateToState().plan(ready, ready, arm).duration == 0.0


@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_end_that_is_too_fast_is_refused_by_joint(arm, ready, end):
    speed = np.zeros(7)
    speed[2] = -1.5
    words = rf"{end} velocity of panda_joint3 should be within 1\.0\d+ but is -1\.5"
    with pytest.raises(TrajectoryError, match=words):
        RuckigStateToState().plan(ready, ready + 0.2, arm, **{f"{end}_velocity": speed})


def test_a_start_that_cannot_stop_before_its_limit_is_refused(arm, ready):
    start, speed = ready.copy(), np.zeros(7)
    start[3], speed[3] = arm.upper[3] - 0.01, 1.0
    with pytest.raises(TrajectoryError, match="takes panda_joint4 to"):
        RuckigStateToState().plan(start, ready, arm, start_velocity=speed)


def test_bad_requests_are_refused_by_name(arm, ready):
    with pytest.raises(ManipulationError, match=r"goal should be 7 joint positions but has shape \(6,\)"):
        RuckigStateToState().plan(ready, ready[:6], arm)
    with pytest.raises(ManipulationError, match="start should be finite"):
        RuckigStateToState().plan(ready * np.nan, ready, arm)
