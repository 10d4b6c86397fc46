"""The track that a skid drive seems to have is found in turns, and mends its odometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.control.inertial import GyroHeading
from bestman_bt.control.wheeled.turning_slip import TurningSlip, measure_turning_slip
from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.model import BaseModel, RobotModel
from bestman_bt.scene.scene import World
from hal.api import Imu, ImuReading, MobileBase
from hal.simulation.ground_truth import GroundTruth
from tests.control.scripted_parts import ScriptedBase
from tests.default_engine import DefaultRobot

FLOOR = World("floor", 0, (), (), (), Pose2D(), {})


def husky(turning_slip: float) -> RobotModel:
    """A bare Husky with an inertial unit; ``turning_slip``: what its odometry counts with."""
    parts = {
        "base": {"part": "husky_base", "set": {"turning_slip": turning_slip}},
        "imu": {"part": "imu", "mount": "base_link"},
    }
    return compose_robot("husky", Document({"base_frame": "base_footprint", "parts": parts}))


def measure(model: RobotModel, seed: int, **how: float) -> TurningSlip:
    with DefaultRobot(model, FLOOR, seed=seed) as robot:
        gyro = GyroHeading(robot.part("imu", Imu), robot.clock)
        present = model.of(BaseModel)["base"].part.turning_slip
        return measure_turning_slip(robot.part("base", MobileBase), gyro, robot.clock, present, **how)


def error_of_a_full_turn(model: RobotModel, seed: int) -> float:
    """How far odometry and truth are apart after a turn of 360 degrees by odometry, radians."""
    with DefaultRobot(model, FLOOR, seed=seed) as robot:
        base, truth, turned, counted = robot.part("base", MobileBase), GroundTruth(robot), 0.0, 0.0
        yaw, heading = truth.base_pose().yaw, base.odometry().theta
        while counted < 2.0 * math.pi:
            base.set_velocity(0.0, 0.0, 0.4)
            robot.clock.sleep(0.05)
            turned, yaw = turned + wrap_angle(truth.base_pose().yaw - yaw), truth.base_pose().yaw
            counted, heading = counted + wrap_angle(base.odometry().theta - heading), base.odometry().theta
        return abs(turned - counted)


@pytest.mark.slow
def test_a_wrong_factor_is_found_and_the_right_one_mends_the_odometry() -> None:
    wrong = husky(2.0)
    found = measure(wrong, seed=1)
    assert found.left == pytest.approx(found.right, rel=0.05)
    before, after = error_of_a_full_turn(wrong, 1), error_of_a_full_turn(husky(found.value), 1)
    assert before > math.radians(20.0)
    assert after < math.radians(5.0)


@pytest.mark.slow
def test_a_base_that_does_not_slip_needs_no_factor() -> None:
    document = read_document(find_data("robot", "diff_panda"))
    model = compose_robot(
        "rolling", document.merged(Document({"parts": {"imu": {"part": "imu", "mount": "base_link"}}}))
    )
    assert measure(model, 1, angle=1.2).value == pytest.approx(1.0, abs=0.03)


class Dragging(ScriptedBase):
    """A base that turns less than its wheels count: by ``left`` and ``right``."""

    left, right = 1.5, 1.25

    def read(self) -> ImuReading:
        rate = float(self.speed[2])
        rate = rate / self.left if rate > 0.0 else rate / self.right
        return ImuReading(np.array([0.0, 0.0, rate + 0.02]), np.zeros(3), self.clock.now())


def test_both_ways_are_measured_against_what_its_odometry_counts_with_now() -> None:
    base = Dragging(Pose2D(), Pose2D(1.0, -2.0, 2.9))
    found = measure_turning_slip(base, GyroHeading(base, base.clock), base.clock, 1.2, angle=5.0)
    assert found.left == pytest.approx(1.2 * 1.5, rel=0.01)
    assert found.right == pytest.approx(1.2 * 1.25, rel=0.01)
    assert found.value == pytest.approx((found.left + found.right) / 2)
    assert found.before == pytest.approx(5.0 * (1 - 1 / 1.5 + 1 - 1 / 1.25) / 2, abs=0.06)
    assert base.told[-1] == Twist2D()
    assert max(abs(twist.wz) for twist in base.told) == pytest.approx(0.6)
    assert np.all(base.speed == 0.0)
