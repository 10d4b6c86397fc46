"""What the robot's YAML allows an xArm at most holds above the controller's own limits."""

from __future__ import annotations

import importlib
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.bringup_file import with_bringup_limits
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm, CommandRefusedError, MotionErrorCode, MotionStatus
from hal.hardware.robot import HardwareRobot
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from hal.xarm.wire import read_report, silenced_sdk
from tests.hal.twinned import twin_settings, wait_for

pytestmark = [pytest.mark.real_time, pytest.mark.slow]

ROBOT = Path(__file__).parent / "xarm6_on_a_base.yaml"
SIDEWAYS = np.array([0.4, 0, 0, 0, 0, 0])


@contextmanager
def connected(twin: TwinProcess, **settings: Any) -> Iterator[HardwareRobot]:
    with HardwareRobot(load_robot_model(ROBOT, twin_settings(twin, **settings))) as robot:
        yield robot


def fastest_tool(robot: HardwareRobot, arm: Arm, motion: Any) -> float:
    """The highest mean speed of the tool over 0.2 s of a motion, by the joints' readings, m/s."""
    tool = ToolLimits(robot.model, "arm", robot.model.safety)
    readings = []  # a busy machine may hold up each: it was taken between two times
    while not motion.done:
        readings.append((robot.clock.now(), tool.tool(arm.positions()), robot.clock.now()))
        robot.clock.sleep(0.2)
    return max(
        float(np.linalg.norm(there - here)) / (after - before)
        for (before, here, _), (_, there, after) in pairwise(readings)
    )


def line(arm: Arm, target: np.ndarray, duration: float) -> JointTrajectory:
    times = np.linspace(0.0, duration, 21)
    share, rate = 3 * (times / duration) ** 2 - 2 * (times / duration) ** 3, 6 * times * (duration - times)
    start = arm.positions()
    ways = (target - start)[None] * share[:, None]
    return JointTrajectory(arm.joint_names, times, start + ways, (target - start)[None] * rate[:, None] / duration**3)


def test_the_tool_never_exceeds_its_speed(twin: TwinProcess) -> None:
    with connected(twin, safety__tool_speed="0.1 m/s") as robot:
        arm = robot.part("arm", Arm)
        here = arm.positions()
        motion = arm.move_to(here + SIDEWAYS)
        assert fastest_tool(robot, arm, motion) < 0.12
        assert motion.status is MotionStatus.SUCCEEDED
        way = line(arm, here, 1.0)
        back = ArmController(arm, robot.clock).follow(way, free=True)  # whose monitor is not misled by the slower pace
        assert fastest_tool(robot, arm, back) < 0.12
        assert back.failure is None
        assert arm.positions() == pytest.approx(here, abs=0.01)


def test_the_trajectorys_own_time_is_reported(twin: TwinProcess) -> None:
    with connected(twin, safety__tool_speed="0.1 m/s") as robot:
        arm = robot.part("arm", Arm)
        assert arm.trajectory_time() is None
        way = line(arm, arm.positions() + SIDEWAYS, 1.0)
        motion = arm.follow(way)
        begun, compared = robot.clock.now(), 0
        while not motion.done:
            robot.clock.sleep(0.1)
            told, passed = arm.trajectory_time(), robot.clock.now() - begun
            if told is None or not 0.4 < told < 0.9:
                continue
            compared += 1
            assert told < 0.95 * passed  # the pace is the tool limit's
            assert arm.positions() == pytest.approx(way.sample(told)[0], abs=0.03)
        assert compared
        assert motion.status is MotionStatus.SUCCEEDED
        back = arm.follow(line(arm, way.positions[0], 1.0))
        while not back.done:
            robot.clock.sleep(0.05)


def test_nothing_leads_the_tool_out_of_its_workspace(twin: TwinProcess) -> None:
    with connected(twin) as robot:
        place = ToolLimits(robot.model, "arm", robot.model.safety).tool(robot.part("arm", Arm).positions())
    box = {side: [f"{at} m" for at in end] for side, end in (("lower", place - 0.05), ("upper", place + 0.05))}
    with connected(twin, safety__workspace=box) as robot:
        arm = robot.part("arm", Arm)
        here = arm.positions()
        with pytest.raises(CommandRefusedError, match="workspace"):
            arm.move_to(here + 2 * SIDEWAYS)
        with pytest.raises(CommandRefusedError, match="workspace"):
            arm.follow(line(arm, here + 2 * SIDEWAYS, 4.0))
        with pytest.raises(CommandRefusedError, match="workspace"):
            arm.command(positions=here + 2 * SIDEWAYS)
        arm.command(velocities=0.5 * SIDEWAYS)
        robot.clock.sleep(0.5)
        wait_for(lambda: float(np.max(np.abs(arm.velocities()))) < 0.01, "the arm rests")
        tool = ToolLimits(robot.model, "arm", robot.model.safety).tool(arm.positions())
        assert np.max(np.abs(tool - place)) < 0.07


def test_the_joint_speed_of_safety_slows_an_arm(twin: TwinProcess) -> None:
    with connected(twin, safety__joint_speed=0.1) as robot:
        arm = robot.part("arm", Arm)
        assert arm.model.velocity[0] == pytest.approx(np.pi / 10)
        with pytest.raises(CommandRefusedError, match="velocities"):
            arm.command(velocities=np.full(6, 0.5))


def test_in_reduced_mode_the_controller_watches_too(twin: TwinProcess) -> None:
    options = {"rate": 100.0, "reduced_mode": True, "collision_sensitivity": 3, "payload": 0.8}
    with connected(twin, connections__arm_controller__options=options) as robot:
        with silenced_sdk():
            other = importlib.import_module("xarm.wrapper").XArmAPI(
                twin.addresses["arm_controller"], is_radian=True, enable_report=False
            )
        assert other.get_reduced_mode() == (0, 1)
        other.set_reduced_max_joint_speed(0.2)
        arm = robot.part("arm", Arm)
        motion = arm.move_to(arm.positions() - SIDEWAYS)
        while not motion.done:
            robot.clock.sleep(0.02)
        other.disconnect()
        assert motion.failure is not None
        assert motion.failure.code is MotionErrorCode.FAULT
        assert motion.failure.vendor_code == "C24"
    twin.fault("arm_controller", "released")


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("other_tool", r"tool is \[0\.0, 0\.0, 5\.0\] mm from the flange"),
        ("other_load", r"counts on \d\.\d\d kg at the flange, the file's hand has"),
        ("other_mounting", r"gravity pulls along \[0\.0, 0\.0, 1\.0\] by the controller"),
    ],
)
def test_what_the_controller_knows_otherwise_is_reported_and_refused_once_the_robot_was_brought_up(
    twin: TwinProcess, fault: str, words: str
) -> None:
    model = load_robot_model(ROBOT, twin_settings(twin))
    twin.fault("arm_controller", fault)
    try:
        with HardwareRobot(model) as robot:
            assert re.search(words, robot.diagnostics()["arm_controller remarks"])
            robot.disconnect()
            twin.fault("arm_controller", "as_built")
            robot.connect()  # the hand may hold something by now: what was found at first still holds
            assert re.search(words, robot.diagnostics()["arm_controller remarks"])
            twin.fault("arm_controller", fault)
        brought_up, _ = with_bringup_limits(model)
        with pytest.raises(ConnectionFailedError, match=words):
            HardwareRobot(brought_up).connect()
        twin.fault("arm_controller", "as_built")
        with HardwareRobot(brought_up) as robot:
            assert "arm_controller remarks" not in robot.diagnostics()
    finally:
        twin.fault("arm_controller", "as_built")


def test_a_payload_is_read_back(twin: TwinProcess) -> None:
    try:
        with connected(twin) as robot:
            arm = robot.part("arm", Arm)
            arm.carry(0.3, (0.0, 0.0, 0.02))
            assert "arm_controller remarks" not in robot.diagnostics()
            twin.fault("arm_controller", "kept_load")
            arm.carry(0.0, (0.0, 0.0, 0.0))
            assert "although it was set to" in robot.diagnostics()["arm_controller remarks"]
            twin.fault("arm_controller", "as_built")
            arm.carry(0.0, (0.0, 0.0, 0.0))
            assert "arm_controller remarks" not in robot.diagnostics()
            twin.fault("arm_controller", "kept_load")
        settings = twin_settings(twin, connections__arm_controller__options={"payload": 0.8})
        with pytest.raises(ConnectionFailedError, match=r"the controller counts on .* although it was set to 0\.80 kg"):
            HardwareRobot(load_robot_model(ROBOT, settings)).connect()
    finally:
        twin.fault("arm_controller", "as_built")


def test_the_controller_is_told_what_the_hand_holds_again_after_a_reconnection(twin: TwinProcess) -> None:
    address = twin.addresses["arm_controller"]

    def counted() -> float:
        told = read_report(address, 5.0)
        assert told is not None
        assert told.payload is not None
        return told.payload

    settings = twin_settings(twin, connections__arm_controller__options={"payload": 0.8})
    with HardwareRobot(load_robot_model(ROBOT, settings)) as robot:
        robot.part("arm", Arm).carry(0.4, (0.0, 0.0, 0.02))
        assert counted() == pytest.approx(1.2)
        twin.fault("arm_controller", "drop")
        wait_for(lambda: robot.stopped, "the robot stops")
        twin.fault("arm_controller", "restore")
        robot.clear_stop()
        assert counted() == pytest.approx(1.2)
        robot.part("arm", Arm).carry(0.0, (0.0, 0.0, 0.0))
        assert counted() == pytest.approx(0.8)


def test_nothing_goes_on_after_the_robot_is_disconnected(twin: TwinProcess) -> None:
    before = set(threading.enumerate())
    with connected(twin) as robot:
        assert set(threading.enumerate()) - before
    # The SDK's own threads look once a second whether they are still needed.
    wait_for(lambda: set(threading.enumerate()) <= before, "all threads end")
    assert robot.diagnostics()["connected"] == "no"


def test_the_sdk_says_nothing_and_leaves_sockets_as_they_were(
    twin: TwinProcess, capfd: pytest.CaptureFixture[str]
) -> None:
    timeout = socket.getdefaulttimeout()
    with connected(twin) as robot:
        robot.clock.sleep(0.1)
    said = capfd.readouterr()
    assert twin.addresses["arm_controller"] not in said.out + said.err
    assert said.out == ""
    assert socket.getdefaulttimeout() == timeout
