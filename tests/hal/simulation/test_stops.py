"""A stop brings simulated joints and fingers to rest in its time, whatever their limits say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.registry import DRIVERS
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
    with DefaultRobot(slow(robot_model), empty_world, seed=2) as robot:
        yield robot


def slow(model: RobotModel) -> RobotModel:
    return replace(model, parts={**model.parts, "arm": with_limits(model.of(ArmModel)["arm"], acceleration=SLOW)})


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


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_stop_ends_efforts_and_the_arm_holds(robot_model: RobotModel, empty_world: World, engine: str) -> None:
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    with DRIVERS.resolve(engine)(slow(robot_model), empty_world, seed=2) as robot:
        arm = robot.part("arm", Arm)
        home, limits = arm.positions(), arm.model
        pushes = np.array([0.0, 0.0, 0.0, 0.0, 3.0, 3.0, -3.0])
        for falling, efforts in ((0.1, 0.0 * pushes), (0.2, 0.0 * pushes), (0.9, 0.0 * pushes), (0.4, pushes)):
            arm.command(efforts=efforts)
            robot.clock.sleep(falling)
            fastest = np.max(np.abs(arm.velocities()) / limits.velocity)
            assert fastest > 0.3, "the arm falls, onto the end of a joint's range or faster than its limits"
            robot.stop()
            robot.clock.sleep(0.5)
            assert np.max(np.abs(arm.velocities())) < 0.01
            there = arm.positions()
            assert np.all((there > limits.lower - 0.01) & (there < limits.upper + 0.01))
            robot.clear_stop()
            robot.clock.sleep(0.5)
            assert arm.positions() == pytest.approx(there, abs=0.005)
            back = arm.move_to(home)
            while not back.done:
                robot.clock.sleep(0.1)
            assert back.status is MotionStatus.SUCCEEDED
