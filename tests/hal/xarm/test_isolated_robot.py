"""A robot's connections in a process of their own: neither process leaves the other or the robot in the lurch."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages.black_box import BlackBox
from bestman_bt.robot_model.model import RobotModel
from hal.api import Arm, CommandRefusedError, MotionErrorCode, MotionStatus, NotConnectedError
from hal.hardware.isolated_robot import PROCESS, STOP_TIME, IsolatedRobot
from hal.twins.process import TwinProcess
from tests.hal.twinned import (
    PATIENCE,
    SLACK,
    arm_comes_to_rest,
    client_program,
    disconnected,
    twin_settings,
    wait_for,
    wait_in_twin,
)
from tests.rigs.twinned_robots import XARM6

pytestmark = [pytest.mark.real_time, pytest.mark.slow]

ROBOT = XARM6.robot_file

FIRST_JOINT = np.eye(6)[0]


def children() -> set[int]:
    """Processes that this one has started and that still run."""
    mine = set()
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == os.getpid() and fields[0] != "Z":
                mine.add(int(folder.name))
    return mine


def test_the_other_process_is_there_only_while_connected(twin_model: RobotModel) -> None:
    before = children()
    with IsolatedRobot(twin_model):
        assert len(children() - before) == 1
    assert children() == before


def test_a_busy_client_does_not_hold_up_a_motion(isolated_robot: IsolatedRobot) -> None:
    arm = isolated_robot.part("arm", Arm)
    here = arm.positions()
    motion = arm.move_to(here + 0.3 * FIRST_JOINT, 0.3)
    while not motion.done:
        sum(range(2_000_000))  # holds the interpreter's lock
    assert motion.status is MotionStatus.SUCCEEDED
    back = arm.move_to(here, 0.3)
    while not back.done:
        isolated_robot.clock.sleep(0.05)


def test_a_motion_that_an_operator_holds_rests_on_its_way_and_goes_on_to_its_end(isolated_robot: IsolatedRobot) -> None:
    arm, clock = isolated_robot.part("arm", Arm), isolated_robot.clock
    start = arm.positions()
    motion = arm.move_to(start + 0.6 * FIRST_JOINT, 0.3)
    wait_for(lambda: float(arm.positions()[0] - start[0]) > 0.05, "the arm moves")
    isolated_robot.set_speed(0.0)
    clock.sleep(1.5)
    here = arm.positions()
    clock.sleep(0.5)
    assert arm.positions() == pytest.approx(here, abs=1e-4)
    assert here[0] - start[0] < 0.5
    assert not motion.done
    isolated_robot.set_speed(1.0)
    wait_for(lambda: motion.done, "the motion goes on")
    assert motion.status is MotionStatus.SUCCEEDED
    back = arm.move_to(start, 0.5)
    wait_for(lambda: back.done, "the arm is back")


def test_stops_are_written_down_by_the_process_that_holds_the_connections(
    isolated_robot: IsolatedRobot, twin: TwinProcess, tmp_path: Path
) -> None:
    arm = isolated_robot.part("arm", Arm)
    isolated_robot.keep_black_box_in(tmp_path)
    start = arm.positions()
    motion = arm.move_to(start + 0.4 * FIRST_JOINT, 0.3)
    wait_for(lambda: abs(float((arm.positions() - start)[0])) > 0.05, "the arm moves")
    isolated_robot.stop()
    isolated_robot.keep_black_box_in(None)  # which waits for it
    assert motion.done
    isolated_robot.clear_stop()
    box = BlackBox.load(tmp_path / "black_box_1.npz")
    joint = arm.joint_names[0]
    arms = box.parts["arm"]
    moved = np.ptp(arms.of(f"measured position {joint}"))
    assert moved == pytest.approx(np.ptp(arms.of(f"set position {joint}")), abs=0.02)
    assert moved > 0.02
    assert box.stopped_at < arms.times[-1] < box.stopped_at + 1.0


def test_where_the_other_process_dies_motions_fail_and_it_can_be_connected_again(
    twin_model: RobotModel, isolated_robot: IsolatedRobot
) -> None:
    with disconnected(isolated_robot):
        its_process_dies(twin_model)


def test_a_robot_process_that_hangs_is_killed_by_the_stop_and_begun_anew_by_clearing_it(
    twin: TwinProcess, twin_model: RobotModel, isolated_robot: IsolatedRobot
) -> None:
    """Its heartbeats are not missed meanwhile, so that only the stop can be late."""
    patient = replace(twin_model, safety=replace(twin_model.safety, heartbeat=60.0))
    with disconnected(isolated_robot):
        before = children()
        with IsolatedRobot(patient) as robot:
            arm = robot.part("arm", Arm)
            motion = arm.move_to(arm.positions() + 0.5 * FIRST_JOINT, 0.1)
            (process,) = children() - before
            os.kill(process, signal.SIGSTOP)
            start = time.monotonic()
            robot.stop()
            assert time.monotonic() - start < STOP_TIME + SLACK
            assert motion.failure is not None
            assert motion.failure.code is MotionErrorCode.DISCONNECTED
            assert robot.stopped
            assert "did not answer a stop" in robot.faults[PROCESS].text
            arm_comes_to_rest(twin)
            robot.clear_stop()
            assert not robot.stopped
            assert not robot.faults
            arm.move_to(arm.positions())
        assert children() == before


def test_a_robot_process_that_hangs_is_killed_where_anything_is_asked_of_it(
    twin_model: RobotModel, isolated_robot: IsolatedRobot
) -> None:
    with disconnected(isolated_robot):
        before = children()
        with IsolatedRobot(twin_model) as robot:
            (process,) = children() - before
            os.kill(process, signal.SIGSTOP)
            with pytest.raises(NotConnectedError, match="did not give a sign of life"):
                robot.part("arm", Arm).positions()
            assert robot.stopped
        assert children() == before


PLANNER = """
import sys, time
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm
from hal.hardware.isolated_robot import IsolatedRobot
settings = dict(zip(sys.argv[2::2], sys.argv[3::2]))
with IsolatedRobot(load_robot_model(sys.argv[1], settings)) as robot:
    arm = robot.part("arm", Arm)
    motion = arm.move_to(arm.positions() + [0.8 if arm.positions()[0] < 0 else -0.8, 0, 0, 0, 0, 0], 0.1)
    print("moves", flush=True)
    while not motion.done:
        robot.clock.sleep(0.05)
    print(motion.failure.code.value, motion.failure.text, flush=True)
    robot.clear_stop()
    arm.move_to(arm.positions())
    print("accepted", flush=True)
"""


def test_while_the_program_that_plans_is_stopped_the_arm_brakes_and_it_hears_so_when_it_goes_on(
    twin: TwinProcess, isolated_robot: IsolatedRobot
) -> None:
    settings = [str(word) for setting in twin_settings(twin).items() for word in setting]
    with disconnected(isolated_robot), client_program(PLANNER, str(ROBOT), *settings) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "moves\n"
        wait_for(lambda: max(map(abs, twin.judge("joints", "arm")["velocities"])) > 0.02, "the arm moves")
        os.kill(program.pid, signal.SIGSTOP)
        wait_in_twin(twin, 0.2 + SLACK)
        arm_comes_to_rest(twin)
        os.kill(program.pid, signal.SIGCONT)
        assert program.stdout.readline().startswith("stopped stopped because the program that plans sent no heartbeat")
        assert program.stdout.readline() == "accepted\n"
        assert program.wait(PATIENCE) == 0


SWING = """
<root BTCPP_format="4" main_tree_to_execute="Swing">
  <BehaviorTree ID="Swing">
    <Repeat num_cycles="-1"><MoveArm posture="home"/></Repeat>
  </BehaviorTree>
</root>
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_to_the_process_group_ends_a_run_with_a_result_and_without_a_traceback(
    twin: TwinProcess, isolated_robot: IsolatedRobot, tmp_path: Path, number: signal.Signals
) -> None:
    (tmp_path / "swing.xml").write_text(SWING)
    command = [sys.executable, "-m", "bestman_bt.cli.main", "run", str(tmp_path / "swing.xml"), "--robot", str(ROBOT)]
    command += ["--driver", "hardware", "--scene", "pick_place_table", "--runs", str(tmp_path / "runs")]
    command += [word for name, value in twin_settings(twin).items() for word in ("--set", f"robot.{name}={value}")]
    pipe = subprocess.PIPE
    with disconnected(isolated_robot):
        with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as run:
            assert run.stderr is not None
            assert "MoveArm running" in run.stderr.readline()
            os.killpg(run.pid, number)
            output, errors = run.communicate(timeout=PATIENCE)
        arm_comes_to_rest(twin)
    assert run.returncode == 130, errors
    assert "Traceback" not in output + errors
    (result,) = (tmp_path / "runs").rglob("result.json")
    assert json.loads(result.read_text())["outcome"] == "cancelled"


def its_process_dies(twin_model: RobotModel) -> None:
    before = children()
    with IsolatedRobot(twin_model) as robot:
        arm = robot.part("arm", Arm)
        motion = arm.move_to(arm.positions() + 0.5 * FIRST_JOINT, 0.1)
        (process,) = children() - before
        os.kill(process, signal.SIGKILL)
        wait_for(lambda: motion.done, "the motion has failed")
        assert motion.failure is not None
        assert motion.failure.code is MotionErrorCode.DISCONNECTED
        with pytest.raises(NotConnectedError, match="has ended"):
            arm.positions()
        robot.stop()
        assert robot.stopped
        robot.connect()
        assert robot.stopped
        robot.clear_stop()
        assert len(arm.positions()) == 6
    assert children() == before


def test_a_stop_is_kept_across_connections(
    twin: TwinProcess, twin_model: RobotModel, isolated_robot: IsolatedRobot
) -> None:
    robot = IsolatedRobot(twin_model)
    robot.stop()
    with disconnected(isolated_robot), robot:
        arm = robot.part("arm", Arm)
        assert robot.stopped
        with pytest.raises(CommandRefusedError, match="stopped"):
            arm.move_to(arm.positions())
        robot.clear_stop()
        assert not robot.stopped
        arm.move_to(arm.positions())
        twin.fault("arm_controller", "protective_stop")
        wait_for(lambda: robot.stopped, "the fault has stopped the robot")
        robot.disconnect()
        twin.fault("arm_controller", "released")
        assert robot.stopped


def test_a_stop_from_another_thread_does_not_wait_for_what_is_asked(isolated_robot: IsolatedRobot) -> None:
    arm = isolated_robot.part("arm", Arm)
    stopped = threading.Event()

    def ask_until_stopped() -> None:
        while not stopped.is_set():
            arm.positions()

    asking, stopping = threading.Thread(target=ask_until_stopped), threading.Thread(target=isolated_robot.stop)
    asking.start()
    stopping.start()
    stopping.join(20.0)
    waits = stopping.is_alive()
    stopped.set()
    asking.join()
    assert not waits
    assert isolated_robot.stopped
    isolated_robot.clear_stop()
