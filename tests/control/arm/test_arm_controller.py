from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import JointTrajectory, MotionErrorCode
from hal.api import MotionStatus


def swing(arm, by: float, duration: float = 1.0) -> JointTrajectory:
    """The first joint turns by ``by`` radians, smoothly."""
    times = np.linspace(0.0, duration, 21)
    share = times / duration
    positions = np.tile(arm.positions(), (21, 1))
    positions[:, 0] += by * (3 * share**2 - 2 * share**3)
    velocities = np.zeros_like(positions)
    velocities[:, 0] = by * (6 * share - 6 * share**2) / duration
    return JointTrajectory(arm.joint_names, times, positions, velocities)


def test_a_trajectory_ends_where_it_should(simulate):
    simulated = simulate()
    trajectory = swing(simulated.arm, 0.4)
    handle = simulated.wait(simulated.arm.follow(trajectory))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    np.testing.assert_allclose(simulated.arm.positions(), trajectory.positions[-1], atol=0.005)


@pytest.mark.slow
def test_moving_point_to_point_ends_where_it_should(simulate):
    simulated = simulate()
    goal = np.add(simulated.arm.positions(), [0.2, 0.1, 0, 0, 0, 0, -0.3])
    handle = simulated.wait(simulated.arm.move_to(goal))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    np.testing.assert_allclose(simulated.arm.positions(), goal, atol=0.005)


@pytest.mark.slow
def test_a_trajectory_that_starts_elsewhere_fails_without_moving(simulate):
    simulated = simulate()
    trajectory = swing(simulated.arm, 0.4)
    before = simulated.arm.positions()
    shifted = JointTrajectory(
        trajectory.joint_names, trajectory.times, trajectory.positions + 0.1, trajectory.velocities
    )
    handle = simulated.arm.follow(shifted)
    simulated.robot.clock.sleep(0.3)
    assert handle.status is MotionStatus.FAILED
    assert handle.failure.code is MotionErrorCode.REFUSED
    np.testing.assert_allclose(simulated.arm.positions(), before, atol=0.002)


def test_a_guard_that_objects_ends_the_motion_with_its_words(simulate):
    simulated = simulate()
    clock = simulated.robot.clock
    deadline = clock.now() + 0.4
    handle = simulated.wait(
        simulated.arm.follow(swing(simulated.arm, 0.4), lambda: "it slipped" if clock.now() > deadline else None)
    )
    assert handle.status is MotionStatus.FAILED
    assert (handle.failure.code, handle.failure.text) == (MotionErrorCode.GUARDED, "it slipped")
    clock.sleep(0.5)
    assert np.abs(simulated.robot.parts["arm"].velocities()).max() < 0.01


def test_cancelling_brings_the_arm_to_rest(simulate):
    simulated = simulate()
    trajectory = swing(simulated.arm, 0.6)
    handle = simulated.arm.follow(trajectory)
    simulated.robot.clock.sleep(0.4)
    handle.cancel()
    simulated.robot.clock.sleep(0.5)
    assert handle.status is MotionStatus.CANCELED
    assert np.abs(simulated.robot.parts["arm"].velocities()).max() < 0.01
    assert abs(simulated.arm.positions()[0] - trajectory.positions[-1, 0]) > 0.05


def test_a_newer_motion_supersedes_the_older(simulate):
    simulated = simulate()
    first = simulated.arm.move_to(np.add(simulated.arm.positions(), [0.5, 0, 0, 0, 0, 0, 0]))
    simulated.robot.clock.sleep(0.1)
    simulated.arm.move_to(simulated.arm.positions())
    assert first.status is MotionStatus.CANCELED
    assert first.failure.code is MotionErrorCode.SUPERSEDED
