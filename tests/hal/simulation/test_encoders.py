"""Encoders of joints and wheels: exact and at once unless the robot file says otherwise; and they can fail."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.scene.scene import World
from hal.api import Arm, JointGroup, MobileBase, MotionErrorCode, MotionStatus, NoDataError
from hal.simulation.robot import SimulatedRobot
from hal.simulation.sensor_pipeline import SensorFault, SensorPipeline
from tests.default_engine import DefaultRobot

NOISE = 0.002


@contextmanager
def panda(world: World, seed: int = 3, **encoders: Any) -> Iterator[SimulatedRobot]:
    """diff_panda; ``encoders``: part → the block of its description."""
    changes = {f"parts.{part}.set": {"encoders": block} for part, block in encoders.items()}
    with DefaultRobot(load_robot_model("diff_panda", changes), world, seed=seed) as robot:
        yield robot


def truth(robot: SimulatedRobot, names: tuple[str, ...]) -> np.ndarray:
    return robot.simulation.joint_states()[:2, robot.simulation.slots(names)]


def drive(robot: SimulatedRobot, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        robot.part("base", MobileBase).set_velocity(0.3, 0.0, 0.2)
        robot.clock.sleep(0.1)


def test_joints_are_told_exactly_and_at_once_unless_the_robot_file_says_otherwise(empty_world: World) -> None:
    with panda(empty_world) as robot:
        for name in ("arm", "head"):
            group = robot.part(name, JointGroup)
            group.move_to(group.positions() + 0.1)
            for _ in range(20):
                robot.clock.sleep(1 / 240)
                positions, velocities = truth(robot, group.joint_names)
                assert np.array_equal(group.positions(), positions)
                assert np.array_equal(group.velocities(), velocities)


def test_noise_is_as_large_as_the_robot_file_says(empty_world: World) -> None:
    with panda(empty_world, arm={"noise": "0.002 rad", "noise_speed": "0.01 rad/s"}) as robot:
        arm = robot.part("arm", Arm)
        errors = []
        for _ in range(200):
            robot.clock.sleep(1 / 240)
            positions, velocities = truth(robot, arm.joint_names)
            errors.append((arm.positions() - positions, arm.velocities() - velocities))
    for deviation, error in zip((NOISE, 0.01), np.swapaxes(errors, 0, 1), strict=True):
        assert error.std() == pytest.approx(deviation, rel=0.1)
        assert abs(error.mean()) < 0.2 * deviation


def test_readings_come_at_their_rate_and_with_their_latency(empty_world: World) -> None:
    with panda(empty_world, arm={"rate": "60 Hz", "latency": "0.1 s"}) as robot:
        arm = robot.part("arm", Arm)
        arm.move_to(arm.positions() + 0.3)
        was, told = [], []
        for _ in range(240):
            robot.clock.sleep(1 / 240)
            was.append(truth(robot, arm.joint_names)[0, 0])
            told.append(arm.positions()[0])
        changes = np.flatnonzero(np.diff(told))
        assert np.diff(changes).min() == 4  # 60 of 240 steps
        for at in changes[changes > 30]:
            assert told[at + 1] == was[at + 1 - 24]


@pytest.mark.slow
def test_equal_seeds_make_equal_noise(empty_world: World) -> None:
    said = []
    for seed in (3, 3, 4):
        with panda(empty_world, seed, arm={"noise": "0.002 rad"}, base={"noise": "0.002 rad"}) as robot:
            drive(robot, 0.5)
            said.append((*robot.part("arm", Arm).positions(), robot.part("base", MobileBase).odometry().x))
    assert said[0] == said[1]
    assert said[0] != said[2]


@pytest.mark.slow
def test_wheel_odometry_comes_late_and_noisy_and_does_not_run_away(empty_world: World) -> None:
    told = []
    for block in ({}, {"latency": "0.2 s"}, {"noise": "0.005 rad", "noise_speed": "0.05 rad/s"}):
        with panda(empty_world, base=block) as robot:
            base = robot.part("base", MobileBase)
            drive(robot, 2.0)
            moving, speed = base.odometry(), base.velocity()
            base.set_velocity(0.0, 0.0, 0.0)
            robot.clock.sleep(2.0)
            told.append((moving.x, base.odometry().x, speed.vx))
    exact, late, noisy = told
    assert exact[0] - late[0] == pytest.approx(0.2 * 0.3, rel=0.25)
    assert late[1] == pytest.approx(exact[1], abs=1e-6)
    assert 0.0 < abs(noisy[1] - exact[1]) < 0.002  # noise of two readings, not of all of them added up
    assert 0.0 < abs(noisy[2] - exact[2]) < 0.02


def test_encoders_that_fail_say_nothing_or_the_same_again(empty_world: World) -> None:
    with panda(empty_world) as robot:
        for name in ("arm", "head", "base"):
            robot.encoders(name).fault = SensorFault.SILENT
        base = robot.part("base", MobileBase)
        for read in (robot.part("arm", Arm).positions, robot.part("head", JointGroup).velocities, base.odometry):
            with pytest.raises(NoDataError, match="delivers no readings"):
                read()
        for name in ("arm", "head", "base"):
            robot.encoders(name).fault = None
        before = base.odometry(), robot.part("arm", Arm).positions()
        for name in ("arm", "base"):
            robot.encoders(name).fault = SensorFault.FROZEN
        drive(robot, 0.5)
        robot.part("arm", Arm).move_to(before[1] + 0.1)
        robot.clock.sleep(0.5)
        assert base.odometry() == before[0]
        assert np.array_equal(robot.part("arm", Arm).positions(), before[1])


def test_what_needs_encoders_fails_with_a_code(empty_world: World) -> None:
    with panda(empty_world) as robot:
        base, arm = robot.part("base", MobileBase), robot.part("arm", Arm)
        here = arm.positions()
        motion = base.move_forward(1.0)
        robot.clock.sleep(0.5)
        robot.encoders("base").fault = SensorFault.SILENT
        robot.encoders("arm").fault = SensorFault.SILENT
        robot.clock.sleep(0.1)
        assert motion.status is MotionStatus.FAILED
        assert motion.failure is not None
        assert motion.failure.code is MotionErrorCode.NO_DATA
        with pytest.raises(NoDataError):
            base.rotate(0.5)
        staying = JointTrajectory(arm.joint_names, np.array([0.0, 1.0]), np.array([here, here]), np.zeros((2, 7)))
        handle = ArmController(arm, robot.clock).follow(staying)
        assert handle.failure is not None
        assert handle.failure.code is MotionErrorCode.NO_DATA
        robot.clock.sleep(1.0)
        wheels = robot.model.of(BaseModel)["base"].part.wheel_joints
        assert np.abs(truth(robot, wheels)[1]).max() < 0.05  # it has braked


@pytest.mark.parametrize(("field", "value"), [("noise", "2 kg"), ("latency", "-1 s"), ("rate", "0 Hz"), ("jitter", 1)])
def test_a_block_with_a_mistake_is_refused_by_name(field: str, value: Any) -> None:
    with pytest.raises(ConfigurationError, match=field):
        load_robot_model("diff_panda", {"parts.arm.set": {"encoders": {field: value}}})


def test_what_was_on_its_way_before_a_reconnection_does_not_arrive_after_it() -> None:
    pipeline = SensorPipeline[str]("a sensor", rate=10.0, latency=0.05)
    for connection, measures_at in (("first", 0.2), ("second", 0.3)):
        simulation: Any = SimpleNamespace(now=0.0, step_observers=[])
        pipeline.start(simulation, lambda connection=connection: connection)
        simulation.now = measures_at
        with pytest.raises(NoDataError, match="nothing yet"):
            pipeline.read()
        simulation.step_observers[0]()
        pipeline.detach()
