"""A Robotiq gripper over both of its protocols, against its twin over a gripper that something can block."""

from __future__ import annotations

import dataclasses
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import GripperModel, RobotModel
from hal.api import CommandRefusedError, Gripper, GripperState, Motion, MotionErrorCode, MotionStatus
from hal.hardware.robot import HardwareRobot
from hal.parts.gripper import CommandedGripper
from hal.parts.part_connection import ConnectionFailedError
from hal.robotiq.connection import RobotiqOptions
from hal.robotiq.wire import ModbusWire
from hal.twins.robotiq_server import RobotiqTwin
from tests.hal.twinned import SLACK

pytestmark = pytest.mark.real_time

HAND = "hand_controller"
STEP = 0.005
ADDRESS = f"127.1.{os.getpid() >> 8 & 255}.{os.getpid() & 255 or 256 - 1}"
"""Of this process alone: tests run side by side."""


class BlockedGripper(Gripper):
    """Moves with the speed asked, and no further than ``obstacle``."""

    def __init__(self, model: GripperModel) -> None:
        super().__init__("gripper")
        self._model, self._width, self._target = model, model.max_width, model.max_width
        self._speed = self.force = 0.0
        self.obstacle = 0.0
        self._motion: Motion[None] | None = None

    @property
    def model(self) -> GripperModel:
        return self._model

    def width(self) -> float:
        return self._width

    def state(self) -> GripperState:
        at_target = abs(self._width - self._target) < 1e-3
        return GripperState(self._motion is not None, at_target, not at_target, False)

    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion[None]:
        self._target, self.force, self._speed = width, force or 0.0, speed or 0.1
        self._motion = Motion(self.name, self.brake)
        return self._motion

    def stop(self) -> None:
        self._motion = None

    def brake(self) -> None:
        self._motion = None

    def tick(self, dt: float) -> None:
        if self._motion is None:
            return
        change = max(-self._speed * dt, min(self._speed * dt, self._target - self._width))
        reached = max(self._width + change, self.obstacle)
        if reached == self._width:
            self._motion.succeed()
            self._motion = None
        self._width = reached


class World:
    """Ticks in real time, as the twins' world does, and holds one gripper."""

    def __init__(self, gripper: BlockedGripper) -> None:
        self.robot = SimpleNamespace(part=lambda name, kind: gripper)
        self.ticks: list[Callable[[float], None]] = [gripper.tick]
        self.without_power: set[str] = set()
        self._work: list[Callable[[], None]] = []
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def post(self, work: Callable[[], None]) -> None:
        self._work.append(work)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.wait(STEP):
            while self._work:
                self._work.pop(0)()
            for tick in self.ticks:
                tick(STEP)


@dataclasses.dataclass
class Bench:
    """A client, its twin, and what the fingers really do."""

    robot: HardwareRobot
    twin: RobotiqTwin
    fingers: BlockedGripper

    @property
    def gripper(self) -> Gripper:
        return self.robot.part("gripper", Gripper)

    def wait_for(self, holds: Callable[[], bool], limit: float = 10.0) -> None:
        deadline = time.monotonic() + limit
        while not holds():
            assert time.monotonic() < deadline, "it does not come about"
            self.robot.clock.sleep(0.01)

    def end(self, motion: Motion, limit: float = 20.0) -> Motion[None]:
        deadline = time.monotonic() + limit
        while not motion.done:
            assert time.monotonic() < deadline, "the motion does not end"
            self.robot.clock.sleep(0.01)
        return motion


@pytest.fixture(scope="session")
def panda() -> RobotModel:
    """Any robot with a gripper."""
    return load_robot_model("diff_panda")


@pytest.fixture(params=["urcap", pytest.param("modbus", marks=pytest.mark.slow)])
def bench(request: pytest.FixtureRequest, panda: RobotModel) -> Iterator[Bench]:
    if request.param == "modbus":
        pytest.importorskip("pymodbus", reason="the extra ur is not installed")
    options = RobotiqOptions(protocol=request.param)
    connection = ConnectionConfig("robotiq", ("gripper",), ADDRESS, free_port(), options=options)
    model = dataclasses.replace(panda, connections={HAND: connection})
    fingers = BlockedGripper(model.of(GripperModel)["gripper"])
    world: Any = World(fingers)
    twin = RobotiqTwin(connection, model, world, ADDRESS)
    world.start()
    twin.start()
    try:
        with HardwareRobot(model) as robot:
            yield Bench(robot, twin, fingers)
    finally:
        twin.close()
        world.close()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind((ADDRESS, 0))
        port: int = probe.getsockname()[1]
        return port


def test_it_goes_to_the_width_asked_and_holds_nothing_there(bench: Bench) -> None:
    for width in (0.02, 0.06):
        motion = bench.end(bench.gripper.move(width, speed=0.1))
        assert motion.status is MotionStatus.SUCCEEDED
        assert bench.gripper.width() == pytest.approx(width, abs=0.002)  # it may still creep to its target
        bench.wait_for(lambda width=width: abs(bench.fingers.width() - width) < 0.001)
        bench.wait_for(lambda width=width: abs(bench.gripper.width() - width) < 0.001)
        assert not bench.gripper.state().object_held


def test_it_feels_what_it_holds_and_that_it_is_gone(bench: Bench) -> None:
    bench.fingers.obstacle = 0.03
    motion = bench.end(bench.gripper.close(force=30.0))
    assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    assert bench.gripper.state().object_held
    assert bench.gripper.width() == pytest.approx(0.03, abs=0.001)
    bench.fingers.obstacle = 0.0
    opened = bench.end(bench.gripper.open())
    assert opened.status is MotionStatus.SUCCEEDED, opened.failure
    assert not bench.gripper.state().object_held
    bench.end(bench.gripper.close())
    assert bench.gripper.state().empty


def test_the_force_asked_arrives_as_its_own_number_and_back(bench: Bench) -> None:
    bench.end(bench.gripper.move(0.05, force=35.0))
    assert bench.fingers.force == pytest.approx(35.0, abs=0.5)


def test_a_stop_halts_moving_fingers(bench: Bench) -> None:
    motion = bench.gripper.move(0.0, speed=0.02)
    bench.wait_for(lambda: bench.fingers.width() < bench.gripper.model.max_width - 0.004)
    bench.robot.stop()
    bench.wait_for(lambda: bench.robot.part("gripper", CommandedGripper).resting)
    bench.robot.clock.sleep(0.1)
    width = bench.fingers.width()
    bench.robot.clock.sleep(0.3)
    assert bench.fingers.width() == pytest.approx(width, abs=1e-4)
    assert motion.status is MotionStatus.CANCELED
    with pytest.raises(CommandRefusedError, match="stopped"):
        bench.gripper.open()


def test_an_overcurrent_fails_the_motion_with_its_number_and_an_activation_clears_it(bench: Bench) -> None:
    bench.twin.faults.trigger("gripper_jam")
    motion = bench.end(bench.gripper.move(0.02))
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.FAULT
    assert motion.failure.vendor_code == "gFLT 14"
    bench.wait_for(lambda: bench.robot.stopped)
    bench.twin.faults.trigger("gripper_free")
    bench.robot.clear_stop()
    assert bench.end(bench.gripper.move(0.02)).status is MotionStatus.SUCCEEDED


def test_a_gripper_without_power_is_a_fault_and_what_it_may_hold_is_not_dropped_by_clearing_it(bench: Bench) -> None:
    bench.fingers.obstacle = 0.03
    bench.end(bench.gripper.close(force=30.0))
    assert bench.gripper.state().object_held
    bench.twin.faults.trigger("power_off")
    bench.wait_for(lambda: bench.robot.stopped)
    bench.twin.faults.trigger("power_on")
    assert bench.robot.faults[HAND].vendor_code in ("gSTA 0", "")  # over Modbus it is silent
    with pytest.raises(ConnectionFailedError, match="would drop what it may hold"):
        bench.robot.clear_stop()
    assert bench.robot.stopped


def test_a_silent_gripper_is_lost_until_it_is_back(bench: Bench) -> None:
    motion = bench.gripper.move(0.0, speed=0.02)
    bench.wait_for(lambda: bench.fingers.width() < bench.gripper.model.max_width - 0.002)
    bench.twin.faults.trigger("drop")
    since = bench.robot.clock.now()
    bench.end(motion)
    bench.wait_for(lambda: bench.robot.stopped_at is not None)
    assert bench.robot.stopped_at is not None
    assert bench.robot.stopped_at - since < 0.3 + SLACK
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.DISCONNECTED
    with pytest.raises(ConnectionFailedError, match=HAND) as refusal:
        bench.robot.clear_stop()
    assert ADDRESS not in str(refusal.value)
    bench.twin.faults.trigger("restore")
    bench.robot.clear_stop()
    opened = bench.end(bench.gripper.open())
    assert opened.status is MotionStatus.SUCCEEDED, opened.failure


def test_an_address_at_which_nobody_answers_is_in_no_log_of_modbus(caplog: pytest.LogCaptureFixture) -> None:
    pytest.importorskip("pymodbus", reason="the extra ur is not installed")
    with socket.socket() as taken:  # bound, and nobody listens
        taken.bind((ADDRESS, 0))
        wire = ModbusWire(import_module, ADDRESS, taken.getsockname()[1], 0.2, 2, 0, 0)
        with caplog.at_level(logging.DEBUG, "pymodbus.logging"), pytest.raises(OSError, match="no device answers"):
            wire.open()
    wire.close()
    assert ADDRESS not in caplog.text
