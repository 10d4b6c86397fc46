"""What goes wrong with a UR stops the robot in time, says why with the vendor's number, and can be cleared."""

from __future__ import annotations

import os
import signal
import time
from functools import partial
from pathlib import Path

import pytest

from hal.api import Arm, MotionErrorCode
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.twinned import (
    WATCHDOG,
    arm_comes_to_rest,
    client_program,
    fails_with_its_number,
    stays_stopped_until_somebody_has_looked,
    stays_stopped_while_away,
    stopped_within,
    strike,
    swing_arm,
    works_again,
)

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]

CONTROLLER = "arm_controller"
ROBOT = Path(__file__).parent / "ur5e_on_a_base.yaml"
swing = partial(swing_arm, speed_scale=0.1)


CLIENT = """
import sys, time
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm
from hal.hardware.robot import HardwareRobot
settings = {f"connections.{name}.address": at for name, at in zip(sys.argv[3::2], sys.argv[4::2])}
settings["safety.watchdog"] = sys.argv[1]
robot = HardwareRobot(load_robot_model(sys.argv[2], settings))
robot.connect()
arm = robot.part("arm", Arm)
motion = arm.move_to(arm.positions() + [1.5 if arm.positions()[0] < 0 else -1.5, 0, 0, 0, 0, 0], 0.2)
while abs(arm.velocities()[0]) < 0.15:
    assert not motion.done, motion.failure
    time.sleep(0.01)
print(robot.connections["arm_controller"]._link._process.pid, flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("sdk_too", [False, True], ids=["the client", "the client and the SDK's process"])
def test_whoever_is_killed_the_arm_comes_to_rest(twin: TwinProcess, sdk_too: bool) -> None:
    robot_file = str(Path(__file__).parent / "ur5e_on_a_base.yaml")
    addresses = [word for pair in twin.addresses.items() for word in pair]
    with client_program(CLIENT, f"{WATCHDOG} s", robot_file, *addresses) as client:
        assert client.stdout is not None
        sdk = int(client.stdout.readline())
        moving = twin.judge("joints", "arm")["velocities"]
        if sdk_too:
            os.kill(sdk, signal.SIGKILL)
        client.kill()
        client.wait()
    assert abs(moving[0]) > 0.1
    arm_comes_to_rest(twin)
    deadline = time.monotonic() + 3.0
    while Path(f"/proc/{sdk}").exists():
        assert time.monotonic() < deadline, "the SDK's process goes on"
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("fault", "code", "number"),
    [
        ("protective_stop", MotionErrorCode.COLLISION, "safety mode 3"),
        ("joint_limit", MotionErrorCode.FAULT, "safety mode 8"),
        ("program_stop", MotionErrorCode.FAULT, "runtime state 1"),
    ],
)
def test_a_stop_of_the_controller_fails_the_motion_with_its_number_and_stops_the_robot(
    robot: HardwareRobot, twin: TwinProcess, fault: str, code: MotionErrorCode, number: str
) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, fault)
    fails_with_its_number(robot, motion, since, CONTROLLER, code, number)
    if fault != "program_stop":
        with pytest.raises(ConnectionFailedError, match="robot release"):
            robot.clear_stop()
        twin.fault(CONTROLLER, "released")
    works_again(robot, swing)


@pytest.mark.parametrize("fault", ["protective_stop", "joint_limit"])
def test_what_the_safety_system_has_stopped_is_released_by_people_only(
    robot: HardwareRobot, twin: TwinProcess, fault: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    motion = swing(robot)
    stopped_within(robot, motion, strike(robot, twin, CONTROLLER, fault), 0.1)
    stays_stopped_until_somebody_has_looked(robot, ROBOT, twin, monkeypatch, tmp_path)
    works_again(robot, swing)


def test_an_sdk_process_that_was_killed_for_its_silence_is_begun_anew(
    robot: HardwareRobot, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, "program_stop")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.FAULT
    twin.fault(CONTROLLER, "drop")
    monkeypatch.setattr("hal.ur.connection.READY_TIME", 0.5)
    with pytest.raises(ConnectionFailedError, match="does not answer within"):
        robot.clear_stop()
    monkeypatch.undo()
    twin.fault(CONTROLLER, "restore")
    works_again(robot, swing)


def test_an_emergency_stop_can_only_be_released_at_the_robot(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, "emergency_stop")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.STOPPED
    with pytest.raises(ConnectionFailedError, match="released at the robot"):
        robot.clear_stop()
    assert robot.stopped
    twin.fault(CONTROLLER, "emergency_release")  # which leaves the arm without power
    with pytest.raises(ConnectionFailedError, match="POWER_OFF: inspect the robot"):
        robot.clear_stop()
    twin.fault(CONTROLLER, "released")
    works_again(robot, swing)


def test_a_pulled_cable_is_noticed_in_time_and_the_stop_stays_until_it_is_back(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, "drop")
    assert stopped_within(robot, motion, since, WATCHDOG + 0.05) is MotionErrorCode.DISCONNECTED
    stays_stopped_while_away(robot, twin, CONTROLLER, "arm", robot.part("arm", Arm).positions)
    twin.fault(CONTROLLER, "restore")
    works_again(robot, swing)


def test_readings_that_come_200_ms_late_stop_the_robot(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, "delay", 0.2)
    assert stopped_within(robot, motion, since, 0.6) in (MotionErrorCode.TIMEOUT, MotionErrorCode.DISCONNECTED)
    twin.fault(CONTROLLER, "restore")
    robot.clock.sleep(0.3)
    works_again(robot, swing)
