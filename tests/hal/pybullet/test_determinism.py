"""The same model, world, seed and commands give the same run, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from hal.api import Lidar
from hal.pybullet.robot import PyBulletRobot


def run(robot_model, world, operator, seed: int) -> list[np.ndarray]:
    """States along a short run with driving, sensing, grasping and lifting."""
    states = []
    with PyBulletRobot(robot_model, world, seed=seed) as robot:
        hand = operator(robot)
        hand.finish(hand.base.move_backward(0.05))
        hand.finish(hand.base.move_forward(0.05))
        states.append(robot.part("lidar", Lidar).scan().ranges)
        hand.grasp("box")
        hand.move_vertically(0.05)
        pose = hand.truth.object_pose("box")
        odometry = hand.base.odometry()
        states += [
            robot.simulation.joint_states().copy(),
            pose.position,
            pose.quaternion,
            np.array([odometry.x, odometry.y, odometry.theta, robot.clock.now()]),
        ]
    return states


@pytest.fixture(scope="module")
def first(robot_model, table_worlds, operator) -> list[np.ndarray]:
    """A run that others are compared with."""
    return run(robot_model, table_worlds["box"], operator, seed=11)


def test_equal_runs_are_equal_to_the_last_bit(first, robot_model, table_worlds, operator) -> None:
    second = run(robot_model, table_worlds["box"], operator, seed=11)
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


@pytest.mark.slow
def test_another_robot_in_the_same_process_changes_nothing(
    first, robot_model, table_worlds, empty_world, operator
) -> None:
    with PyBulletRobot(robot_model, empty_world, seed=1) as other:
        other.clock.sleep(0.1)
        beside = run(robot_model, table_worlds["box"], operator, seed=11)
    assert all(np.array_equal(a, b) for a, b in zip(first, beside, strict=True))


@pytest.mark.slow
def test_another_seed_gives_other_noise(first, robot_model, table_worlds, operator) -> None:
    second = run(robot_model, table_worlds["box"], operator, seed=12)
    assert not np.array_equal(first[0], second[0])
    assert not np.array_equal(first[-1], second[-1])
