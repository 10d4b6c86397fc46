"""What goes wrong with an xArm stops the robot in time, says why with the vendor's number, and can be cleared."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from hal.api import Arm, CommandRefusedError, Gripper, MotionErrorCode, MotionStatus
from hal.hardware.robot import HardwareRobot
from hal.twins.process import TwinProcess
from tests.hal.twinned import (
    WATCHDOG,
    arm_comes_to_rest,
    client_program,
    disconnected,
    ended,
    fails_with_its_number,
    stays_stopped_until_somebody_has_looked,
    stays_stopped_while_away,
    stopped_within,
    strike,
    swing_arm,
    wait_for,
    works_again,
)

pytestmark = pytest.mark.real_time

CONTROLLER = "arm_controller"
ROBOT = Path(__file__).parent / "xarm6_on_a_base.yaml"
swing = partial(swing_arm, speed_scale=0.2)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("fault", "code", "number"),
    [("protective_stop", MotionErrorCode.COLLISION, "C31"), ("joint_limit", MotionErrorCode.FAULT, "C23")],
)
def test_an_error_of_the_controller_fails_the_motion_with_its_number_and_stops_the_robot(
    robot: HardwareRobot,
    twin: TwinProcess,
    fault: str,
    code: MotionErrorCode,
    number: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, fault)
    fails_with_its_number(robot, motion, since, CONTROLLER, code, number)
    stays_stopped_until_somebody_has_looked(robot, ROBOT, twin, monkeypatch, tmp_path)
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


@pytest.mark.slow
def test_a_link_that_takes_200_ms_is_taken_for_lost(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = swing(robot)
    since = strike(robot, twin, CONTROLLER, "delay", 0.2)
    assert stopped_within(robot, motion, since, 0.6) in (MotionErrorCode.DISCONNECTED, MotionErrorCode.TIMEOUT)
    twin.fault(CONTROLLER, "restore")
    works_again(robot, swing)


@pytest.mark.slow
def test_a_slow_link_slows_the_motion_down_and_fails_it_without_a_jump(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = swing(robot)
    twin.fault(CONTROLLER, "delay", 0.04)
    ended(robot, motion)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT
    assert "too slowly" in motion.failure.text
    twin.fault(CONTROLLER, "restore")
    robot.clock.sleep(0.5)
    assert CONTROLLER not in robot.faults  # the controller has seen no jump of the set-points
    works_again(robot, swing)


def test_a_jammed_gripper_fails_its_motion_with_the_grippers_number(robot: HardwareRobot, twin: TwinProcess) -> None:
    twin.fault(CONTROLLER, "gripper_jam")
    gripper = robot.part("gripper", Gripper)
    motion = gripper.move(0.02)
    ended(robot, motion)
    assert motion.failure is not None
    assert motion.failure.vendor_code == "G34"
    wait_for(lambda: robot.stopped, "the robot stops")
    arm = robot.part("arm", Arm)
    with pytest.raises(CommandRefusedError) as refused:
        arm.servo(arm.positions())
    failure = refused.value.failure
    assert (failure.code, failure.part, failure.vendor_code) == (MotionErrorCode.REFUSED, "arm", "G34")
    twin.fault(CONTROLLER, "gripper_free")
    robot.clear_stop()
    freed = gripper.move(0.05)
    ended(robot, freed)
    assert freed.status is MotionStatus.SUCCEEDED


CLIENT = """
import sys, time
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm
from hal.hardware.isolated_robot import IsolatedRobot
settings = {"connections.arm_controller.address": sys.argv[2], "safety.watchdog": sys.argv[3]}
robot = IsolatedRobot(load_robot_model(sys.argv[1], settings))
robot.connect()
arm = robot.part("arm", Arm)
motion = arm.move_to(arm.positions() + [1.5 if arm.positions()[0] < 0 else -1.5, 0, 0, 0, 0, 0], 0.2)
while abs(arm.velocities()[0]) < 0.15:
    assert not motion.done, motion.failure
    time.sleep(0.01)
print("moving", flush=True)
time.sleep(60)
"""


@pytest.mark.slow
def test_a_client_that_is_killed_leaves_the_arm_at_rest(robot: HardwareRobot, twin: TwinProcess) -> None:
    robot_file = str(Path(__file__).parent / "xarm6_on_a_base.yaml")
    with disconnected(robot):
        with client_program(CLIENT, robot_file, twin.addresses[CONTROLLER], f"{WATCHDOG} s") as client:
            assert client.stdout is not None
            assert client.stdout.readline() == "moving\n"
            moving = twin.judge("joints", "arm")["velocities"]
            client.kill()
            client.wait()
        assert abs(moving[0]) > 0.1
        arm_comes_to_rest(twin)


STARTER = """
import os, signal, sys
from hal.twins.process import TwinProcess
twin = TwinProcess(sys.argv[1], "pick_place_table")
twin.start()
print(twin.process.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_twins_end_with_the_program_that_started_them(twin: TwinProcess) -> None:
    robot_file = str(Path(__file__).parent / "xarm6_on_a_base.yaml")
    arguments = [sys.executable, "-c", STARTER, robot_file]
    done = subprocess.run(arguments, stdout=subprocess.PIPE, text=True, check=False, timeout=120)
    assert done.returncode == -signal.SIGKILL
    process = Path(f"/proc/{int(done.stdout)}")
    deadline = time.monotonic() + 15.0
    while process.exists() and "Z" not in (process / "stat").read_text().split()[2]:
        assert time.monotonic() < deadline, "the twins go on"
        time.sleep(0.1)
