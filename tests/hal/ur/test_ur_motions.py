"""Motions that a UR's controller plans by itself, its digital outputs, its one client, and faults of a UR alone."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.robot_model.model import RobotModel
from hal.api import CommandRefusedError, ForceTorque, MotionErrorCode, MotionStatus
from hal.hardware.robot import HardwareRobot
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from hal.twins.ur_kinematics import URKinematics
from hal.ur.arm import URArm
from hal.ur.connection import URConnection
from tests.hal.twinned import arrived, ended, stopped_within, strike, wait_for, wait_in_twin, works_again
from tests.rigs.twinned_robots import ARM, UR_ARM

pytestmark = [pytest.mark.real_time, pytest.mark.alone]

STEP = np.array([0.3, 0, 0, 0, 0, 0])


def test_a_path_leads_through_its_waypoints(robot: HardwareRobot) -> None:
    arm = robot.part("arm", URArm)
    start = arm.positions()
    furthest = start[0]
    motion = arm.move_path([start + STEP, start], speed_scale=0.5, blend=0.01)
    while not motion.done:
        robot.clock.sleep(0.01)
        furthest = max(furthest, arm.positions()[0])
    assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    assert furthest == pytest.approx(start[0] + 0.3, abs=0.05)  # looked at now and then
    assert arm.positions() == pytest.approx(start, abs=0.005)
    assert ended(robot, arm.move_to(start + STEP)).status is MotionStatus.SUCCEEDED  # set-points go on from there
    arrived(robot, arm.move_to(start))


def test_a_path_that_is_stopped_comes_to_rest_at_once(robot: HardwareRobot, twin: TwinProcess) -> None:
    arm = robot.part("arm", URArm)
    motion = arm.move_path([arm.positions() + 3 * STEP], speed_scale=0.1)
    wait_for(lambda: abs(arm.velocities()[0]) > 0.1, "the path begins")
    with pytest.raises(CommandRefusedError, match="still moves"):
        arm.speed_joints(STEP, 1.0)
    with pytest.raises(CommandRefusedError, match="stop"):
        arm.move_to(arm.positions())
    robot.stop()
    wait_in_twin(twin, 0.5)
    assert motion.status is MotionStatus.CANCELED
    assert np.max(np.abs(twin.judge("joints", "arm")["velocities"])) < 0.01


@pytest.mark.slow
def test_joint_speeds_end_by_themselves(robot: HardwareRobot) -> None:
    arm = robot.part("arm", URArm)
    start = arm.positions()
    motion = ended(robot, arm.speed_joints(-STEP, 1.0))
    assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    assert arm.positions()[0] == pytest.approx(start[0] - 0.3, abs=0.05)
    assert ended(robot, arm.move_to(start)).status is MotionStatus.SUCCEEDED  # set-points go on from there


@pytest.mark.slow
@pytest.mark.parametrize("path", [False, True])
def test_a_motion_of_the_controller_that_nobody_renews_is_stopped(
    robot: HardwareRobot, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch, path: bool
) -> None:
    arm = robot.part("arm", URArm)
    monkeypatch.setattr("hal.ur.arm.RENEWAL", 60.0)
    way = arm.positions() + 4 * STEP
    motion = arm.move_path([way], speed_scale=0.1) if path else arm.speed_joints(0.5 * STEP, 30.0)
    wait_for(lambda: abs(arm.velocities()[0]) > 0.1, "the arm sets out")
    wait_for(lambda: abs(arm.velocities()[0]) < 0.01, "the arm comes to rest")
    wait_in_twin(twin, 0.3)
    assert np.max(np.abs(twin.judge("joints", "arm")["velocities"])) < 0.01
    monkeypatch.undo()
    assert ended(robot, motion).status is MotionStatus.FAILED
    assert path or "not renewed" in str(motion.failure)  # a path that rests is over, and has ended elsewhere


@pytest.mark.slow
def test_no_motion_is_over_before_it_began(robot: HardwareRobot) -> None:
    arm = robot.part("arm", URArm)
    for sign in (1, -1) * 10:
        # Set-points before it: then the watchdog is due, and must not be fed over the command that moves the arm.
        assert ended(robot, arm.move_to(arm.positions() + 0.02 * sign * STEP)).status is MotionStatus.SUCCEEDED
        begun, start = robot.clock.now(), arm.positions()[0]
        motion = ended(robot, arm.speed_joints(sign * STEP, 0.15))
        assert motion.status is MotionStatus.SUCCEEDED, motion.failure
        assert robot.clock.now() - begun > 0.15
        assert sign * (arm.positions()[0] - start) > 0.01


def test_a_tool_velocity_is_that_of_the_arms_base_frame(robot: HardwareRobot) -> None:
    arm = robot.part("arm", URArm)
    tool = ToolLimits(robot.model, "arm", robot.model.safety)
    moved = ended(robot, arm.move_to(robot.model.posture("home", arm.joint_names)))
    assert moved.status is MotionStatus.SUCCEEDED, moved.failure
    motion = arm.speed_tool([0.05, 0.0, 0.03, 0.0, 0.0, 0.0], 2.0)
    times, places = [], []
    while not motion.done:
        robot.clock.sleep(0.02)
        before, at, after = robot.clock.now(), arm.positions(), robot.clock.now()
        if after - before < 0.005:  # else a busy machine held up the reading
            times.append(before)
            places.append(tool.tool(at))
    assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    steady = (np.array(times) > times[0] + 0.5) & (np.array(times) < times[0] + 1.7)
    velocity = np.polyfit(np.array(times)[steady], np.array(places)[steady], 1)[0]
    # The arm stands upright and unturned on the robot's base, so both frames have the same axes.
    assert velocity == pytest.approx([0.05, 0.0, 0.03], abs=0.005)


def test_the_wrist_feels_the_weight_of_the_hand(robot: HardwareRobot) -> None:
    sensor = robot.part("wrist_force_torque", ForceTorque)
    wrench = sensor.wrench()
    assert abs(wrench.stamp - robot.clock.now()) < 0.1
    assert 5.0 < np.linalg.norm(wrench.force) < 14.0  # 0.9 kg of palm and fingers, and the sensor's offset


@pytest.mark.slow
def test_motions_of_the_controller_begin_at_the_operators_speed_and_not_while_the_robot_is_held(
    robot: HardwareRobot,
) -> None:
    arm = robot.part("arm", URArm)
    start = arm.positions()
    robot.set_speed(0.0)
    try:
        motion = arm.speed_joints([0.2, 0, 0, 0, 0, 0], duration=1.0)
        robot.clock.sleep(0.5)
        assert not motion.done
        assert arm.positions() == pytest.approx(start, abs=2e-3)
        robot.set_speed(0.5)
        ended(robot, motion)
    finally:
        robot.set_speed(1.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert arm.positions()[0] - start[0] == pytest.approx(0.1, abs=0.04)


def test_the_controller_counts_on_what_the_hand_holds_also_after_its_program_was_begun_anew(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    connection, arm = robot.connections[ARM], robot.part("arm", URArm)
    assert isinstance(connection, URConnection)

    def counted() -> float:
        facts = connection.arm_facts()
        assert facts is not None
        assert facts.payload is not None
        return facts.payload

    hand = counted()
    arm.carry(1.5, (0.0, 0.0, 0.02))
    wait_for(lambda: abs(counted() - hand - 1.5) < 1e-3, "the controller counts on it")
    loaded = URKinematics(robot.model, "arm").holding_torques(arm.positions(), 1.5)
    wait_for(lambda: bool(np.allclose(arm.efforts(), loaded, atol=0.2)), "the controller holds it")
    twin.fault(ARM, "program_stop")
    wait_for(lambda: robot.stopped, "the robot stops")
    robot.clear_stop()
    wait_for(lambda: abs(counted() - hand - 1.5) < 1e-3, "the controller counts on it")
    arm.carry(0.0, (0.0, 0.0, 0.0))
    wait_for(lambda: abs(counted() - hand) < 1e-3, "the controller counts on the hand alone")


def test_outputs_are_switched_read_back_and_refused_while_stopped(robot: HardwareRobot) -> None:
    connection = robot.connections[ARM]
    assert isinstance(connection, URConnection)
    for kind in ("standard", "configurable", "tool"):
        for on in (True, False):
            connection.io.set_output(kind, 1, on)
            wait_for(lambda kind=kind, on=on: connection.io.output(kind, 1) is on, "the output is read back")
            assert not connection.io.output(kind, 0)
    with pytest.raises(CommandRefusedError, match="no tool"):
        connection.io.set_output("tool", 2, True)
    robot.stop()
    with pytest.raises(CommandRefusedError, match="stopped"):
        connection.io.set_output("tool", 0, True)


def test_a_second_client_is_refused_as_long_as_the_first_one_is_there(
    robot: HardwareRobot, twin_model: RobotModel, twin: TwinProcess
) -> None:
    with pytest.raises(ConnectionFailedError, match=ARM) as refusal:
        HardwareRobot(twin_model).connect()
    assert twin.addresses[ARM] not in str(refusal.value)


@pytest.mark.slow
def test_a_motion_keeps_to_a_speed_slider_that_the_arm_could_not_follow(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    arm = robot.part("arm", URArm)
    start = arm.positions()
    twin.fault(ARM, "speed_slider", 0.1)
    try:
        motion = ended(robot, arm.move_to(start + 2 * STEP))
        assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    finally:
        twin.fault(ARM, "speed_slider", 1.0)
    arrived(robot, arm.move_to(start))


@pytest.mark.slow
@pytest.mark.parametrize("by_the_controller", [False, True])
def test_a_motion_waits_while_the_program_is_paused_and_goes_on(
    robot: HardwareRobot, twin: TwinProcess, by_the_controller: bool
) -> None:
    arm = robot.part("arm", URArm)
    start = arm.positions()
    motion = (
        arm.move_path([start + 2 * STEP], speed_scale=0.3)
        if by_the_controller
        else arm.move_to(start + 2 * STEP, speed_scale=0.3)
    )
    wait_for(lambda: abs(arm.positions()[0] - start[0]) > 0.1, "the arm sets out")
    twin.fault(ARM, "pause")
    wait_in_twin(twin, 0.5)
    assert np.max(np.abs(twin.judge("joints", "arm")["velocities"])) < 0.01
    assert not motion.done
    assert not robot.stopped
    twin.fault(ARM, "play")
    assert ended(robot, motion).status is MotionStatus.SUCCEEDED, motion.failure
    assert arm.positions() == pytest.approx(start + 2 * STEP, abs=0.005)
    arrived(robot, arm.move_to(start))


@pytest.mark.slow
def test_an_arm_that_was_stopped_while_its_program_is_paused_stands_when_it_is_played(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    arm = robot.part("arm", URArm)
    start = arm.positions()
    arm.move_to(start + 4 * STEP, speed_scale=0.5)
    wait_for(lambda: abs(arm.velocities()[0]) > 0.5, "the arm sets out")
    twin.fault(ARM, "pause")
    wait_for(lambda: abs(arm.velocities()[0]) < 0.01, "the arm comes to rest")
    robot.stop()
    wait_in_twin(twin, 0.5)
    there = np.array(twin.judge("joints", "arm")["positions"])
    twin.fault(ARM, "play")
    wait_in_twin(twin, 0.5)
    assert twin.judge("joints", "arm")["positions"] == pytest.approx(there, abs=1e-3)
    robot.clear_stop()
    arrived(robot, arm.move_to(start))


@pytest.mark.slow
def test_an_sdk_process_that_was_killed_for_its_silence_is_begun_anew(
    robot: HardwareRobot, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = UR_ARM.begin(robot)
    since = strike(robot, twin, ARM, "program_stop")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.FAULT
    twin.fault(ARM, "drop")
    monkeypatch.setattr("hal.ur.connection.READY_TIME", 0.5)
    with pytest.raises(ConnectionFailedError, match="does not answer within"):
        robot.clear_stop()
    monkeypatch.undo()
    twin.fault(ARM, "restore")
    works_again(robot, UR_ARM.begin)


@pytest.mark.slow
def test_an_emergency_stop_can_only_be_released_at_the_robot(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = UR_ARM.begin(robot)
    since = strike(robot, twin, ARM, "emergency_stop")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.STOPPED
    with pytest.raises(ConnectionFailedError, match="released at the robot"):
        robot.clear_stop()
    assert robot.stopped
    twin.fault(ARM, "emergency_release")  # which leaves the arm without power
    with pytest.raises(ConnectionFailedError, match="POWER_OFF: inspect the robot"):
        robot.clear_stop()
    twin.fault(ARM, "released")
    works_again(robot, UR_ARM.begin)
