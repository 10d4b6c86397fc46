"""What can go wrong with a ROS robot alone; all else is in tests/hal/hardware/test_faults.py."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.sensor_parts import LidarPart
from hal.api import Camera, CommandRefusedError, Lidar, MobileBase, MotionErrorCode, MotionStatus, NoDataError
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.twinned import disconnected, ended, stopped_within, strike, twin_settings, wait_for, works_again
from tests.rigs.twinned_robots import PLATFORM, ROS, base_comes_to_rest, turn

pytestmark = pytest.mark.real_time


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
    base_comes_to_rest(twin)
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
def test_scans_of_a_synchronised_robot_are_as_old_as_they_are_and_clocks_that_step_are_reported(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    model = load_robot_model(ROS.robot_file, twin_settings(twin, connections__platform__options__clock="synchronised"))
    with disconnected(robot), HardwareRobot(model) as believing:
        lidar, ages = believing.part("lidar", Lidar), []
        for _ in range(40):
            believing.clock.sleep(0.02)
            ages.append(believing.clock.now() - lidar.scan().stamp)
        assert -0.002 < min(ages) - model.of(LidarPart)["lidar"].latency < 0.04
        twin.fault(PLATFORM, "clock_back")
        wait_for(lambda: believing.stopped, "the robot stops")
        with pytest.raises(ConnectionFailedError, match=r"/odom is stamped 0\.\d\d s before its arrival"):
            believing.clear_stop()
        believing.disconnect()
        with pytest.raises(
            ConnectionFailedError, match=r"stamped 0\.\d\d s before its arrival: .*options\.clock: estimated"
        ):
            believing.connect()


@pytest.mark.slow
def test_a_base_that_does_not_move_fails_its_motion_in_words(robot: HardwareRobot, twin: TwinProcess) -> None:
    twin.fault(PLATFORM, "stuck")
    motion = robot.part("base", MobileBase).move_backward(0.1)
    ended(robot, motion)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT
    assert "0.100 m remain" in motion.failure.text
    assert not robot.stopped


@pytest.mark.slow
def test_a_blind_camera_reports_what_did_not_come_and_the_robot_goes_on(
    robot: HardwareRobot, twin: TwinProcess
) -> None:
    twin.fault(PLATFORM, "blind")
    with pytest.raises(NoDataError, match="no image on /head_camera/color"):
        robot.part("head_camera", Camera).capture()
    assert not robot.stopped
    twin.fault(PLATFORM, "sighted")
    assert robot.part("head_camera", Camera).capture().rgb.any()
