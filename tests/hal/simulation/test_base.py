"""A base drives by its wheels and stands still when it should."""

from __future__ import annotations

import numpy as np
import pytest

from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot

WELL_CALIBRATED = DefaultRobot.parameters_class(odometry_calibration=0.0)


def drive(robot: SimulatedRobot, hand) -> tuple[float, float, float]:
    start = hand.truth.base_pose()
    hand.finish(hand.base.move_forward(1.0))
    robot.clock.sleep(0.3)
    moved = start.inverse() @ hand.truth.base_pose()
    return float(moved.position[0]), float(moved.position[1]), moved.yaw


@pytest.mark.slow
def test_one_metre_is_one_metre_when_the_wheels_are_calibrated(robot_model, empty_world, operator) -> None:
    with DefaultRobot(robot_model, empty_world, seed=5, parameters=WELL_CALIBRATED) as robot:
        hand = operator(robot)
        x, y, yaw = drive(robot, hand)
        assert x == pytest.approx(1.0, abs=0.012)
        assert abs(y) < 0.01
        assert abs(yaw) < 0.02
        assert hand.base.odometry().x == pytest.approx(1.0, abs=0.005)


def test_odometry_drifts_with_the_calibration_of_the_wheels(robot_model, empty_world, operator) -> None:
    with DefaultRobot(
        robot_model, empty_world, seed=5, parameters=DefaultRobot.parameters_class(odometry_calibration=0.02)
    ) as robot:
        hand = operator(robot)
        x, y, yaw = drive(robot, hand)
        believed = hand.base.odometry()
        assert believed.x == pytest.approx(1.0, abs=0.005)
        assert max(abs(x - believed.x), abs(y - believed.y), abs(yaw - believed.theta)) > 0.01


@pytest.mark.slow
def test_a_standing_base_keeps_its_place_while_the_arm_swings(robot_model, empty_world, operator) -> None:
    with DefaultRobot(robot_model, empty_world, seed=5) as robot:
        hand = operator(robot)
        start, carry = hand.truth.base_pose(), hand.arm.positions()
        for _ in range(2):
            hand.finish(hand.arm.move_to(robot.model.posture("home", hand.arm.joint_names), 0.5))
            hand.finish(hand.arm.move_to(carry, 0.5))
        moved = start.inverse() @ hand.truth.base_pose()
        assert np.linalg.norm(moved.position[:2]) < 0.002
        assert abs(moved.yaw) < np.radians(0.15)


@pytest.mark.slow
def test_a_standing_base_does_not_creep(robot_model, empty_world, operator) -> None:
    with DefaultRobot(robot_model, empty_world, seed=5) as robot:
        hand = operator(robot)
        start = hand.truth.base_pose()
        robot.clock.sleep(5.0)
        moved = start.inverse() @ hand.truth.base_pose()
        assert np.linalg.norm(moved.position) < 1e-4
        assert abs(moved.yaw) < 1e-4


@pytest.mark.slow
def test_the_commanded_velocity_changes_within_the_acceleration_limits(standing_robot) -> None:
    base = standing_robot.part("base", type(standing_robot.parts["base"]))
    limit = base.model.part.max_acceleration
    for _ in range(2):  # also after a stop, which brakes harder
        speeds = []
        for _ in range(12):
            base.set_velocity(0.5, 0.0, 0.0)
            standing_robot.clock.sleep(0.05)
            speeds.append(base.velocity().vx)
        base.stop()
        standing_robot.clock.sleep(0.5)
        assert abs(base.velocity().vx) < 0.01
        standing_robot.clock.sleep(0.5)
        assert np.max(np.diff([0.0, *speeds])) / 0.05 < 1.3 * limit
        assert speeds[-1] == pytest.approx(0.5 * min(1.0, 12 * 0.05 * limit / 0.5), rel=0.15)
    motion, speeds = base.move_forward(0.3), []
    while not motion.done:
        standing_robot.clock.sleep(0.05)
        speeds.append(base.velocity().vx)
    assert motion.failure is None
    assert np.max(np.diff([0.0, *speeds])) / 0.05 < 1.3 * limit


def test_a_velocity_lapses_after_the_dead_mans_time(standing_robot) -> None:
    base = standing_robot.part("base", type(standing_robot.parts["base"]))
    for _ in range(2):
        base.set_velocity(0.2, 0.0, 0.0)
        speeds = []
        for _ in range(60):
            standing_robot.clock.sleep(1 / 60)
            speeds.append(base.velocity().vx)
        timeout = base.command_timeout
        fastest = int(np.argmax(speeds)) / 60
        assert timeout - 0.03 < fastest < timeout + 0.05
        assert abs(speeds[-1]) < 0.005
