"""A stop brings simulated joints and fingers to rest in its time, whatever their limits say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.scene.scene import World
from hal.api import Arm, CommandRefusedError, Gripper, MotionErrorCode, MotionStatus
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot
from tests.robot_models import with_limits

SLOW = 0.4
"""rad/s²: within the limits the arm would take over a second to stop."""


@pytest.fixture(scope="module")
def robot(robot_model: RobotModel, empty_world: World) -> Iterator[SimulatedRobot]:
    arm = with_limits(robot_model.of(ArmModel)["arm"], acceleration=SLOW)
    with DefaultRobot(replace(robot_model, parts={**robot_model.parts, "arm": arm}), empty_world, seed=2) as robot:
        yield robot


@pytest.mark.parametrize("end", ["robot", "part", "cancel"])
def test_a_slow_arm_stops_within_half_a_second(robot: SimulatedRobot, end: str) -> None:
    arm = robot.part("arm", Arm)
    here = arm.positions()
    motion = arm.move_to(here + np.array([1.2 if here[0] < 0 else -1.2, 0, 0, 0, 0, 0, 0]))
    robot.clock.sleep(1.2)
    assert abs(arm.velocities()[0]) > 0.4
    {"robot": robot.stop, "part": arm.stop, "cancel": motion.cancel}[end]()
    assert motion.status is MotionStatus.CANCELED
    assert motion.failure is not None
    assert motion.failure.code is (MotionErrorCode.CANCELED if end == "cancel" else MotionErrorCode.STOPPED)
    robot.clock.sleep(0.5)
    assert np.max(np.abs(arm.velocities())) < 0.01
    there = arm.positions()
    robot.clear_stop()
    robot.clock.sleep(0.5)
    assert arm.positions() == pytest.approx(there, abs=0.002)


def test_stopped_fingers_halt_and_go_on_only_when_they_are_told_to(robot: SimulatedRobot) -> None:
    gripper = robot.part("gripper", Gripper)
    motion = gripper.move(0.0, speed=0.05)
    robot.clock.sleep(0.6)
    robot.stop()
    robot.clock.sleep(0.2)
    width = gripper.width()
    assert 0.02 < width < 0.07
    assert motion.status is MotionStatus.CANCELED
    assert not gripper.state().moving
    with pytest.raises(CommandRefusedError, match="stopped"):
        gripper.open()
    robot.clear_stop()
    robot.clock.sleep(0.5)
    assert gripper.width() == pytest.approx(width, abs=0.002)


def test_a_stop_ends_efforts_and_the_arm_holds(robot: SimulatedRobot) -> None:
    arm = robot.part("arm", Arm)
    holding = arm.efforts()  # without them it falls onto the end of a joint's range
    arm.command(efforts=holding + np.array([5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    robot.clock.sleep(0.1)
    assert arm.velocities()[0] > 0.3
    robot.stop()
    robot.clock.sleep(0.5)
    assert np.max(np.abs(arm.velocities())) < 0.01
    there = arm.positions()
    robot.clear_stop()
    robot.clock.sleep(0.5)
    assert arm.positions() == pytest.approx(there, abs=0.005)
