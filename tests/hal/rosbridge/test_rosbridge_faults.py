"""What goes wrong with a ROS robot stops it in time, says why, and can be cleared."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.sensor_parts import LidarPart
from hal.api import (
    Camera,
    CommandRefusedError,
    Lidar,
    MobileBase,
    Motion,
    MotionErrorCode,
    MotionStatus,
    NoDataError,
)
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.twinned import (
    WATCHDOG,
    client_program,
    disconnected,
    ended,
    stays_stopped_while_away,
    stopped_within,
    strike,
    twin_settings,
    wait_for,
    wait_in_twin,
    works_again,
)

pytestmark = pytest.mark.real_time
PLATFORM = "platform"
ROBOT = Path(__file__).parent / "ros_robot.yaml"


def turn(robot: HardwareRobot) -> Motion:
    """A turn on the spot that is well under way."""
    base = robot.part("base", MobileBase)
    motion = base.rotate(2.0)
    wait_for(lambda: motion.done or base.velocity().wz > 0.3, "the base turns")
    assert not motion.done, motion.failure
    return motion


def place(twin: TwinProcess) -> np.ndarray:
    return np.array(twin.judge("base_pose")["quaternion"] + twin.judge("base_pose")["position"])


def stands(twin: TwinProcess) -> None:
    """The base has come to rest by itself: its dead-man, then braking from 1.2 rad/s at its own 2 rad/s²."""
    wait_in_twin(twin, 0.25 + 0.6 + 0.15)
    before = place(twin)
    wait_in_twin(twin, 0.4)
    assert np.max(np.abs(place(twin) - before)) < 1e-3


@pytest.mark.slow
def test_a_pulled_cable_is_noticed_in_time_and_no_velocity_acts_when_it_is_back(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    motion = turn(robot)
    since = strike(robot, twin, PLATFORM, "drop")
    assert stopped_within(robot, motion, since, WATCHDOG + 0.05) is MotionErrorCode.DISCONNECTED
    stays_stopped_while_away(robot, twin, PLATFORM, "base", robot.part("base", MobileBase).odometry)
    stands(twin)
    twin.fault(PLATFORM, "restore")
    stands(twin)
    works_again(robot, turn)


@pytest.mark.parametrize(
    ("fault", "words"),
    [pytest.param("stale_odometry", "/odom", marks=pytest.mark.slow), ("silent_odometry", "/odom is .* old")],
)
def test_odometry_that_stays_behind_stops_the_robot(
    robot: HardwareRobot, twin: TwinProcess, fault: str, words: str
) -> None:
    motion = turn(robot)
    since = strike(robot, twin, PLATFORM, fault)
    assert stopped_within(robot, motion, since, 0.35) is MotionErrorCode.TIMEOUT
    assert motion.status is MotionStatus.FAILED
    with pytest.raises(CommandRefusedError, match=words):
        robot.part("base", MobileBase).rotate(1.0)
    stands(twin)
    twin.fault(PLATFORM, "fresh_odometry")
    works_again(robot, turn)


@pytest.mark.slow
def test_a_clock_of_ros_that_is_set_back_and_transforms_that_are_dated_ahead_stop_nothing(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    base = robot.part("base", MobileBase)
    twin.fault(PLATFORM, "clock_back")
    for _ in range(20):
        robot.clock.sleep(0.05)
        base.odometry()
        robot.part("lidar", Lidar).scan()
    assert not robot.stopped, robot.faults


@pytest.mark.slow
def test_scans_of_a_synchronised_robot_are_as_old_as_they_are_and_clocks_that_step_are_told(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    model = load_robot_model(ROBOT, twin_settings(twin, connections__platform__options__clock="synchronised"))
    with disconnected(robot), HardwareRobot(model) as believing:
        lidar, ages = believing.part("lidar", Lidar), []
        for _ in range(40):
            believing.clock.sleep(0.02)
            ages.append(believing.clock.now() - lidar.scan().stamp)
        assert -0.002 < min(ages) - model.of(LidarPart)["lidar"].latency < 0.04
        twin.fault(PLATFORM, "clock_back")
        wait_for(lambda: believing.stopped, "the robot stops")
        with pytest.raises(ConnectionFailedError, match=r"/odom is stamped 0\.\d\d s before it comes"):
            believing.clear_stop()
        believing.disconnect()
        with pytest.raises(
            ConnectionFailedError, match=r"stamped 0\.\d\d s before it comes: .*options\.clock: estimated"
        ):
            believing.connect()


@pytest.mark.slow
def test_readings_that_come_200_ms_late_stop_the_robot(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = turn(robot)
    since = strike(robot, twin, PLATFORM, "delay", 0.2)
    stopped_within(robot, motion, since, 0.6)
    assert motion.status is MotionStatus.FAILED
    twin.fault(PLATFORM, "restore")
    robot.clock.sleep(0.3)
    works_again(robot, turn)


@pytest.mark.slow
def test_a_rosbridge_that_is_started_anew_stops_the_robot_until_it_is_connected_again(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    motion = turn(robot)
    since = strike(robot, twin, PLATFORM, "restart")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.DISCONNECTED
    stands(twin)
    works_again(robot, turn)


@pytest.mark.slow
def test_a_base_that_does_not_move_fails_its_motion_in_words(robot: HardwareRobot, twin: TwinProcess) -> None:
    twin.fault(PLATFORM, "stuck")
    motion = robot.part("base", MobileBase).move_backward(0.1)
    ended(robot, motion)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT
    assert "0.100 m are left" in motion.failure.text
    assert not robot.stopped


@pytest.mark.slow
def test_a_blind_camera_says_what_did_not_come_and_the_robot_goes_on(robot: HardwareRobot, twin: TwinProcess) -> None:
    twin.fault(PLATFORM, "blind")
    with pytest.raises(NoDataError, match="no image on /head_camera/color"):
        robot.part("head_camera", Camera).capture()
    assert not robot.stopped
    twin.fault(PLATFORM, "sighted")
    assert robot.part("head_camera", Camera).capture().rgb.any()


CLIENT = """
import sys, time
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import MobileBase
from hal.hardware.robot import HardwareRobot
settings = {"connections.platform.address": sys.argv[2], "safety.watchdog": sys.argv[3]}
robot = HardwareRobot(load_robot_model(sys.argv[1], settings))
robot.connect()
base = robot.part("base", MobileBase)
motion = base.rotate(-3.0)
while base.velocity().wz > -0.6:
    assert not motion.done, motion.failure
    time.sleep(0.01)
print(base.velocity().wz, flush=True)
time.sleep(60)
"""


@pytest.mark.slow
def test_a_client_that_is_killed_leaves_the_base_at_rest(twin: TwinProcess) -> None:
    robot_file = str(Path(__file__).parent / "ros_robot.yaml")
    with client_program(CLIENT, robot_file, twin.addresses[PLATFORM], f"{WATCHDOG} s") as client:
        assert client.stdout is not None
        assert float(client.stdout.readline()) < -0.5
        client.kill()
        client.wait()
    stands(twin)


@pytest.mark.slow
def test_nothing_is_left_of_a_connection_that_has_ended(twin_model: RobotModel) -> None:
    with HardwareRobot(twin_model) as robot:
        robot.part("lidar", Lidar).scan()
    left = threading.active_count()
    for _ in range(3):
        with HardwareRobot(twin_model) as robot:
            robot.part("lidar", Lidar).scan()
    assert threading.active_count() <= left
    with IsolatedRobot(twin_model) as isolated:
        isolated.part("lidar", Lidar).scan()
    children = Path(f"/proc/self/task/{threading.main_thread().native_id}/children").read_text().split()
    commands = [Path(f"/proc/{child}/cmdline").read_text() for child in children]
    assert not [command for command in commands if "robot_process" in command]
