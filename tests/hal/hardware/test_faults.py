"""What goes wrong with a controller stops the robot in time, says why, and can be cleared: each fault, each vendor."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from bestman_bt.robot_model.model import RobotModel
from hal.api import Arm, CommandRefusedError, Motion, MotionErrorCode, MotionStatus, NotConnectedError
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.twinned import (
    WATCHDOG,
    client_program,
    disconnected,
    ended,
    stopped_within,
    strike,
    twin_settings,
    wait_for,
    wait_in_twin,
    works_again,
)
from tests.rigs.twinned_robots import (
    ROBOTIQ,
    ROS_BASE,
    UR5E,
    UR_ARM,
    XARM_ARM,
    XARM_HAND,
    Controller,
    fixtures_of,
)

pytestmark = pytest.mark.real_time

twinned, twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of()

LATE = {MotionErrorCode.TIMEOUT, MotionErrorCode.DISCONNECTED, MotionErrorCode.STOPPED}


@dataclass(frozen=True, eq=False)  # pytest would put equal ones together, and not those of a robot
class Case:
    """A controller, what happens to it and what is expected. ``undo``: the fault that ends ``fault``."""

    controller: Controller
    fault: str = ""
    code: MotionErrorCode | None = None
    number: str = ""
    undo: str = "restore"
    client: str = ""
    quick: bool = False


def on(*cases: Case) -> pytest.MarkDecorator:
    """Each case on its robot. A UR's set-points at 500 Hz take the whole machine."""
    parameters = []
    for case in cases:
        name = " ".join(word for word in (case.controller.name, case.fault, case.client) if word)
        marks = [] if case.quick else [pytest.mark.slow]
        alone = [pytest.mark.alone] if case.controller.robot is UR5E else []
        parameters.append(pytest.param(case.controller.robot, case, id=name, marks=marks + alone))
    return pytest.mark.parametrize(("twinned", "case"), parameters, indirect=["twinned"], scope="module")


def fails_with_its_number(case: Case, robot: HardwareRobot, motion: Motion, since: float) -> None:
    """A controller's fault fails the motion with the vendor's number, and stops the robot for that reason."""
    assert stopped_within(robot, motion, since, 0.1) is case.code
    assert motion.status is MotionStatus.FAILED
    assert case.number in str(motion.failure)
    connection = case.controller.connection
    assert robot.faults[connection].vendor_code == case.number
    assert case.number in robot.diagnostics()[connection]
    with pytest.raises(CommandRefusedError, match=case.number) as refused:
        robot.part("arm", Arm).move_to(robot.part("arm", Arm).positions())
    failure = refused.value.failure
    assert (failure.code, failure.part, failure.vendor_code) == (MotionErrorCode.STOPPED, "arm", case.number)


def stays_stopped_until_somebody_has_looked(
    robot: HardwareRobot, robot_file: Path, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    """Neither ``clear_stop()`` nor connecting anew clears it; ``bestman-bt robot release`` does, and logs who."""
    with pytest.raises(ConnectionFailedError, match="bestman-bt robot release"):
        robot.clear_stop()
    robot.disconnect()
    with pytest.raises(ConnectionFailedError, match="bestman-bt robot release"):
        robot.connect()
    assert robot.stopped
    connection = "arm_controller"
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    settings = (f"robot.connections.{name}.address={at}" for name, at in twin.addresses.items())
    command = ["robot", "release", str(robot_file), *(word for one in settings for word in ("--set", one))]
    refused = subprocess.run(
        [sys.executable, "-m", "bestman_bt.cli.main", *command],
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert refused.returncode == 2
    assert "--yes" in refused.stderr
    assert robot.connections[connection].held() is not None
    told = subprocess.run(
        [sys.executable, "-m", "bestman_bt.cli.main", *command, "--yes", "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    (line,) = (folder / "bestman-bt" / "releases.jsonl").read_text().splitlines()
    assert json.loads(line) == json.loads(told.stdout)["released"][0]
    assert json.loads(line)["controller"] == connection
    assert twin.addresses[connection] not in told.stdout + told.stderr + line
    robot.connect()


@on(
    Case(XARM_ARM, "protective_stop", MotionErrorCode.COLLISION, "C31", quick=True),
    Case(XARM_ARM, "joint_limit", MotionErrorCode.FAULT, "C23"),
    Case(UR_ARM, "protective_stop", MotionErrorCode.COLLISION, "safety mode 3"),
    Case(UR_ARM, "joint_limit", MotionErrorCode.FAULT, "safety mode 8"),
)
def test_a_safety_stop_fails_the_motion_with_its_number_and_is_released_by_people_only(
    case: Case, robot: HardwareRobot, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    motion = case.controller.begin(robot)
    since = strike(robot, twin, case.controller.connection, case.fault)
    fails_with_its_number(case, robot, motion, since)
    stays_stopped_until_somebody_has_looked(robot, case.controller.robot.robot_file, twin, monkeypatch, tmp_path)
    works_again(robot, case.controller.begin)


@on(
    Case(XARM_HAND, "gripper_jam", MotionErrorCode.FAULT, "G34", "gripper_free", quick=True),
    Case(ROBOTIQ, "gripper_jam", MotionErrorCode.FAULT, "gFLT 14", "gripper_free"),
    Case(UR_ARM, "program_stop", MotionErrorCode.FAULT, "runtime state 1"),
)
def test_a_fault_of_the_machine_fails_the_motion_with_its_number_and_can_be_cleared(
    case: Case, robot: HardwareRobot, twin: TwinProcess
) -> None:
    motion = case.controller.begin(robot)
    since = strike(robot, twin, case.controller.connection, case.fault)
    fails_with_its_number(case, robot, motion, since)
    twin.fault(case.controller.connection, case.undo)
    works_again(robot, case.controller.begin)


@on(Case(XARM_ARM, quick=True), Case(UR_ARM), Case(ROBOTIQ), Case(ROS_BASE))
def test_a_pulled_cable_is_noticed_in_time_and_nothing_moves_when_it_is_back(
    case: Case, robot: HardwareRobot, twin: TwinProcess
) -> None:
    motion = case.controller.begin(robot)
    since = strike(robot, twin, case.controller.connection, "drop")
    assert stopped_within(robot, motion, since, WATCHDOG + 0.05) is MotionErrorCode.DISCONNECTED
    with pytest.raises(NotConnectedError, match=case.controller.part):
        case.controller.read(robot)
    with pytest.raises(ConnectionFailedError, match=case.controller.connection) as refusal:
        robot.clear_stop()
    assert twin.addresses[case.controller.connection] not in str(refusal.value)
    assert robot.stopped
    case.controller.rests(twin)
    twin.fault(case.controller.connection, "restore")
    case.controller.rests(twin)
    works_again(robot, case.controller.begin)


@on(Case(XARM_ARM), Case(UR_ARM), Case(ROBOTIQ), Case(ROS_BASE))
def test_a_connection_that_is_closed_stops_the_robot_until_it_is_connected_again(
    case: Case, robot: HardwareRobot, twin: TwinProcess
) -> None:
    motion = case.controller.begin(robot)
    since = strike(robot, twin, case.controller.connection, "restart")
    assert stopped_within(robot, motion, since, WATCHDOG + 0.05) is MotionErrorCode.DISCONNECTED
    case.controller.rests(twin)
    works_again(robot, case.controller.begin)


@on(Case(XARM_ARM), Case(UR_ARM), Case(ROBOTIQ), Case(ROS_BASE))
def test_readings_that_come_200_ms_late_stop_the_robot(case: Case, robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = case.controller.begin(robot)
    since = strike(robot, twin, case.controller.connection, "delay", 0.2)
    # A reply that was under way is still heard, and an xArm's silence counts from there.
    assert stopped_within(robot, motion, since, 0.2 + WATCHDOG) in LATE
    assert motion.status is MotionStatus.FAILED
    twin.fault(case.controller.connection, "restore")
    robot.clock.sleep(0.3)
    works_again(robot, case.controller.begin)


@on(Case(XARM_ARM, code=MotionErrorCode.TIMEOUT), Case(UR_ARM), Case(ROBOTIQ), Case(ROS_BASE))
def test_a_link_that_takes_40_ms_fails_a_motion_at_most_and_without_a_jump(
    case: Case, robot: HardwareRobot, twin: TwinProcess
) -> None:
    """Each set-point of an xArm waits for its answer, so that its motions become slow."""
    motion = case.controller.begin(robot)
    twin.fault(case.controller.connection, "delay", 0.04)
    ended(robot, motion)
    assert (motion.failure.code if motion.failure else None) is case.code
    if case.code is MotionErrorCode.TIMEOUT:
        assert "too slowly" in str(motion.failure)
    twin.fault(case.controller.connection, "restore")
    robot.clock.sleep(0.5)
    assert case.controller.connection not in robot.faults  # the controller has seen no jump of the set-points
    works_again(robot, case.controller.begin)


CLIENT = """
import json, sys, time
from bestman_bt.robot_model.compose import load_robot_model
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot
from tests.rigs.twinned_robots import CONTROLLERS
controller, kind = CONTROLLERS[sys.argv[1]], IsolatedRobot if sys.argv[2] == "isolated" else HardwareRobot
robot = kind(load_robot_model(controller.robot.robot_file, json.loads(sys.argv[3])))
robot.connect()
controller.begin(robot)
print("moving", flush=True)
time.sleep(60)
"""


def children_of(process: int) -> dict[int, str]:
    """The processes that a process has begun, by their ids, each with its command line."""
    children = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended meanwhile
            if int((folder / "stat").read_text().rpartition(")")[2].split()[1]) == process:
                children[int(folder.name)] = (folder / "cmdline").read_text()
    return children


@on(
    Case(XARM_ARM, client="isolated"),
    Case(UR_ARM, client="alone"),
    Case(UR_ARM, client="with its processes"),
    Case(ROS_BASE, client="alone"),
)
def test_a_client_that_is_killed_leaves_the_robot_at_rest_and_no_process_behind(
    case: Case, robot: HardwareRobot, twin: TwinProcess
) -> None:
    settings = json.dumps(twin_settings(twin))
    with disconnected(robot), client_program(CLIENT, case.controller.name, case.client, settings) as client:
        assert client.stdout is not None
        assert client.stdout.readline() == "moving\n"
        children = children_of(client.pid)
        before = case.controller.place(twin)
        wait_in_twin(twin, 0.05)
        assert max(abs(case.controller.place(twin) - before)) > 2e-3
        if case.client == "with its processes":
            for child in children:
                os.kill(child, signal.SIGKILL)
        client.kill()
        client.wait()
        case.controller.rests(twin)
        wait_for(lambda: not any(Path(f"/proc/{child}").exists() for child in children), "its processes end")


@on(Case(XARM_ARM), Case(UR_ARM), Case(ROS_BASE))
def test_nothing_is_left_of_a_connection_that_has_ended(
    case: Case, robot: HardwareRobot, twin_model: RobotModel
) -> None:
    def connect(kind: type[HardwareRobot | IsolatedRobot]) -> None:
        with kind(twin_model) as another:
            case.controller.read(another)

    with disconnected(robot):
        connect(HardwareRobot)
        left = threading.active_count()
        connect(HardwareRobot)
        wait_for(lambda: threading.active_count() <= left, "its threads end")  # one of the xArm's SDK takes a second
        connect(IsolatedRobot)
        assert not [
            command
            for command in children_of(os.getpid()).values()
            if "robot_process" in command or "sdk_process" in command
        ]
