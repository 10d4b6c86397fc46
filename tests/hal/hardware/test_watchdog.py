"""A fault of a controller stops the robot: there is no moment after it at which a command is still accepted."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace

import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import BaseModel, RobotModel
from hal.api import CommandRefusedError, Failure, MobileBase, MotionErrorCode, MotionStatus
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.heartbeat import Heartbeat
from hal.hardware.robot import HardwareRobot
from hal.parts.channels import BaseChannel, BaseReading
from hal.parts.driven_base import DrivenBase
from hal.parts.part_connection import ConnectionFailedError
from tests.hal.twinned import wait_for

WAIT = 10.0
"""Seconds that the watchdog's thread gets, which looks a hundred times a second."""


class Standing(BaseChannel):
    """A base that does not move, whatever it is told."""

    def read(self) -> BaseReading:
        return BaseReading(Pose2D(0.0, 0.0, 0.0), Twist2D(0.0, 0.0, 0.0))

    def send(self, velocity: Twist2D) -> bool:
        return True


class Controller(Connection):
    """Reports ``told``; whoever commands its base as soon as its motion has failed is an impatient program."""

    told: Failure | Exception | None = None
    busy, looked = 0.0, 0
    answer: CommandRefusedError | None = None

    def factories(self) -> Mapping[str, PartFactory]:
        self.noticed = threading.Event()
        return {"base": self.make_base}

    def make_base(self, name: str, model: BaseModel) -> DrivenBase:
        self.base = DrivenBase(name, model, Standing(), self.latch)
        return self.base

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def heard(self) -> float:
        return self.clock.now()

    def reported_fault(self) -> Failure | None:
        time.sleep(self.busy)
        self.looked += 1
        if isinstance(self.told, Exception):
            raised, self.told = self.told, None
            raise raised
        return self.told

    def recover(self) -> None:
        self.told = None

    def fail(self, fault: Failure) -> None:
        super().fail(fault)
        try:
            self.base.rotate(1.0)
        except CommandRefusedError as error:
            self.answer = error
        self.noticed.set()


@pytest.fixture
def robot(robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> Iterator[HardwareRobot]:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    with HardwareRobot(replace(robot_model, connections={"platform": ConnectionConfig("any", ("base",))})) as robot:
        yield robot


def test_a_command_at_the_moment_at_which_a_fault_fails_a_motion_is_refused(robot: HardwareRobot) -> None:
    controller = robot.connections["platform"]
    assert isinstance(controller, Controller)
    motion = robot.part("base", MobileBase).rotate(1.0)
    controller.told = Failure(MotionErrorCode.FAULT, "a wheel is blocked")
    assert controller.noticed.wait(WAIT)
    assert motion.status is MotionStatus.FAILED
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.FAULT
    assert "stopped because platform: a wheel is blocked" in str(controller.answer)


def test_a_robot_whose_watchdog_has_ended_by_an_error_is_stopped_and_gets_a_new_one_before_it_takes_commands(
    robot: HardwareRobot,
) -> None:
    controller = robot.connections["platform"]
    assert isinstance(controller, Controller)
    controller.told = ZeroDivisionError("of a driver")
    wait_for(lambda: robot.stopped, "the error of the watchdog has stopped the robot")
    with pytest.raises(CommandRefusedError, match="the watchdog stopped working: ZeroDivisionError"):
        robot.part("base", MobileBase).rotate(1.0)
    robot.clear_stop()
    motion = robot.part("base", MobileBase).rotate(1.0)
    controller.told = Failure(MotionErrorCode.FAULT, "a wheel is blocked")
    wait_for(lambda: motion.done, "the new watchdog sees the fault")


def test_silence_while_this_program_was_held_up_itself_is_distinguished_from_a_controllers(
    robot: HardwareRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = robot.connections["platform"]
    assert isinstance(controller, Controller)

    def told(code: MotionErrorCode, held_up: float) -> str:
        monkeypatch.setattr("hal.hardware.robot.HELD_UP", held_up)
        controller.busy, controller.looked = 0.06, 0
        wait_for(lambda: controller.looked > 1, "the watchdog is held up")
        controller.busy, controller.told = 0.0, Failure(code, "nothing was heard")
        wait_for(lambda: robot.stopped, "the fault stops the robot")
        words = robot.faults["platform"].text
        robot.clear_stop()
        return words

    assert told(MotionErrorCode.TIMEOUT, held_up=10.0) == "nothing was heard"
    assert told(MotionErrorCode.FAULT, held_up=0.05) == "nothing was heard"
    assert re.fullmatch(
        r"nothing was heard, and this program was itself held up for 0\.\d\d s: this machine may be too busy",
        told(MotionErrorCode.TIMEOUT, held_up=0.05),
    )


class Signs(Heartbeat):
    """Of a program that plans, which are silent on demand."""

    def __init__(self) -> None:
        self.longest_silence, self.silent = 0.2, 0.0

    @property
    def silence(self) -> float:
        return self.silent


def test_a_silent_program_stops_the_robot_and_can_clear_that_once_it_is_back(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    monkeypatch.setattr("hal.hardware.robot.FOUND_AGAIN_TIME", 0.02)
    model, signs = replace(robot_model, connections={"platform": ConnectionConfig("any", ("base",))}), Signs()
    with HardwareRobot(model, planner=signs) as robot:
        motion = robot.part("base", MobileBase).rotate(1.0)
        signs.silent = 0.01
        wait_for(lambda: motion.done, "the silence is noticed")
        assert motion.failure is not None
        assert motion.failure.code is MotionErrorCode.STOPPED
        assert "no heartbeat for 0.2 s" in motion.failure.text
        with pytest.raises(ConnectionFailedError, match="sends no heartbeat"):
            robot.clear_stop()
        assert robot.stopped
        signs.silent = 0.0
        robot.clear_stop()
        robot.part("base", MobileBase).rotate(1.0)
