"""The track that a skid drive seems to have is found in turns, and mends its odometry."""

from __future__ import annotations

import math

import pytest

from bestman_bt.configuration import Document, find_data, read_document
from bestman_bt.control.wheeled import TurningSlip, measure_turning_slip
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.robot_model import RobotModel, compose_robot
from bestman_bt.scene import World
from bestman_bt.sensing.inertial import GyroHeading
from hal.api import Imu, MobileBase
from hal.pybullet import GroundTruth, PyBulletRobot

FLOOR = World("floor", 0, (), (), (), Pose2D(), {})


def husky(turning_slip: float) -> RobotModel:
    """A bare Husky with an inertial unit; ``turning_slip``: what its odometry counts with."""
    parts = {
        "base": {"part": "husky_base", "set": {"turning_slip": turning_slip}},
        "imu": {"part": "imu", "mount": "base_link"},
    }
    return compose_robot("husky", Document({"base_frame": "base_footprint", "parts": parts}))


def measure(model: RobotModel, seed: int) -> TurningSlip:
    with PyBulletRobot(model, FLOOR, seed=seed) as robot:
        gyro = GyroHeading(robot.part("imu", Imu), robot.clock)
        present = model.bases["base"].turning_slip
        return measure_turning_slip(robot.part("base", MobileBase), gyro, robot.clock, present)


def error_of_a_full_turn(model: RobotModel, seed: int) -> float:
    """How far odometry and truth are apart after a turn of 360 degrees by odometry, radians."""
    with PyBulletRobot(model, FLOOR, seed=seed) as robot:
        base, truth, turned, counted = robot.part("base", MobileBase), GroundTruth(robot), 0.0, 0.0
        yaw, heading = truth.base_pose().yaw, base.odometry().theta
        while counted < 2.0 * math.pi:
            base.set_velocity(0.0, 0.0, 0.4)
            robot.clock.sleep(0.05)
            turned, yaw = turned + wrap_angle(truth.base_pose().yaw - yaw), truth.base_pose().yaw
            counted, heading = counted + wrap_angle(base.odometry().theta - heading), base.odometry().theta
        return abs(turned - counted)


def test_a_wrong_factor_is_found_and_the_right_one_mends_the_odometry() -> None:
    wrong = husky(2.0)
    found = measure(wrong, seed=1)
    assert found.left == pytest.approx(found.right, rel=0.05)
    before, after = error_of_a_full_turn(wrong, 1), error_of_a_full_turn(husky(found.value), 1)
    assert before > math.radians(20.0)
    assert after < math.radians(5.0)


def test_a_base_that_does_not_slip_needs_no_factor() -> None:
    document = read_document(find_data("robot", "diff_panda"))
    model = compose_robot(
        "rolling", document.merged(Document({"parts": {"imu": {"part": "imu", "mount": "base_link"}}}))
    )
    assert measure(model, seed=1).value == pytest.approx(1.0, abs=0.02)
