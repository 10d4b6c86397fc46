from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import JointTrajectory
from tests.rigs.limit_usage import limit_usage


@pytest.fixture
def swing(arm):
    """One joint at 0.5 sin(4 t): at most 2 rad/s, 8 rad/s², 32 rad/s³."""
    times = np.linspace(0, 2, 401)
    positions, velocities = np.zeros((2, len(times), 7))
    positions[:, 3] = -1.5
    positions[:, 0], velocities[:, 0] = 0.5 * np.sin(4 * times), 2 * np.cos(4 * times)
    return JointTrajectory(arm.joint_names, times, positions, velocities)


def test_the_shares_are_those_of_the_known_motion(arm, swing):
    usage = limit_usage(swing, arm, np.full(7, 64.0))
    assert usage.velocity == pytest.approx(2 / arm.velocity[0], rel=0.01)
    assert usage.acceleration == pytest.approx(8 / arm.acceleration[0], rel=0.01)
    assert usage.jerk == pytest.approx(0.5, rel=0.02)
    assert usage.position == 0.0


def test_a_motion_that_is_twice_as_fast_is_reported_by_each_limit(arm, swing):
    twice = JointTrajectory(swing.joint_names, swing.times / 2, swing.positions, 2 * swing.velocities)
    usage = limit_usage(twice, arm, np.full(7, 64.0))
    assert not usage.within()
    assert usage.acceleration == pytest.approx(32 / arm.acceleration[0], rel=0.01)
    assert usage.jerk == pytest.approx(4.0, rel=0.02)


def test_other_joints_and_bad_jerk_limits_are_refused(arm, swing):
    other = JointTrajectory(("a",), np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)))
    with pytest.raises(ManipulationError, match="but the motion is of"):
        limit_usage(other, arm)
    with pytest.raises(ManipulationError, match="jerk should be 7 limits above 0"):
        limit_usage(swing, arm, np.zeros(7))
