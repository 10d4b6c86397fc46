from __future__ import annotations

from typing import ClassVar

import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.control.inertial import FusedOdometry, GyroHeading
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.localization.ekf import OdometryEkf, OdometryEstimate, OdometryFilter, WheelOdometry
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.api import Imu, MobileBase
from hal.simulation.ground_truth import GroundTruth
from tests.default_engine import DefaultRobot


class Remembering(OdometryFilter):
    """Notes what it is told."""

    uses_gyro: ClassVar[bool] = True

    def __init__(self) -> None:
        self.turned, self.elapsed = 0.0, 0.0

    def start(self, odometry: Pose2D) -> OdometryEstimate:
        self.turned = self.elapsed = 0.0
        return OdometryEstimate(odometry)

    def update(self, before: OdometryEstimate, odometry: Pose2D, turned: float, elapsed: float) -> OdometryEstimate:
        self.turned += turned
        self.elapsed += elapsed
        return OdometryEstimate(odometry)


@pytest.fixture(scope="module")
def robot():
    with_imu = Document({"parts": {"imu": {"part": "imu", "mount": "base_link"}}})
    model = compose_robot("feeling_panda", read_document(find_data("robot", "diff_panda")).merged(with_imu))
    with DefaultRobot(model, draw_world(load_scene("kitchen"), 1), seed=1) as connected:
        yield connected


def turn(robot, odometry: FusedOdometry, seconds: float) -> Pose2D:
    base = robot.part("base", MobileBase)
    pose = odometry.pose()
    for _ in range(round(seconds / 0.025)):
        base.set_velocity(0.0, 0.0, 0.6)
        robot.clock.sleep(0.025)
        pose = odometry.pose()
    base.set_velocity(0.0, 0.0, 0.0)
    return pose


def test_the_filter_is_told_what_the_gyroscope_feels_and_how_much_time_passes(robot):
    told = Remembering()
    odometry = FusedOdometry(
        robot.part("base", MobileBase), robot.clock, told, GyroHeading(robot.part("imu", Imu), robot.clock)
    )
    truth = GroundTruth(robot)
    odometry.begin()
    before = truth.base_pose().yaw
    turn(robot, odometry, 2.0)
    turned = wrap_angle(truth.base_pose().yaw - before)
    odometry.end()
    assert told.elapsed == pytest.approx(2.0, abs=0.01)
    assert told.turned == pytest.approx(turned, abs=0.03)


@pytest.mark.slow
def test_wheels_that_count_too_much_are_put_right_by_the_gyroscope(robot, monkeypatch):
    base = robot.part("base", MobileBase)
    counted = base.odometry
    monkeypatch.setattr(base, "odometry", lambda: Pose2D(0.0, 0.0, 1.15 * counted().theta))
    odometry = FusedOdometry(base, robot.clock, OdometryEkf(), GyroHeading(robot.part("imu", Imu), robot.clock))
    truth = GroundTruth(robot)
    odometry.begin()
    for _ in range(40):  # at rest the bias is learned
        robot.clock.sleep(0.025)
        start = odometry.pose()
    before, by_wheels = truth.base_pose().yaw, base.odometry().theta
    pose = turn(robot, odometry, 2.0)
    turned = wrap_angle(truth.base_pose().yaw - before)
    odometry.end()
    assert base.odometry().theta - by_wheels > 1.05 * turned
    assert pose.theta - start.theta == pytest.approx(turned, abs=0.03)


def test_without_a_gyroscope_a_filter_that_needs_one_is_refused_and_the_wheels_stay_what_they_are(robot):
    base = robot.part("base", MobileBase)
    with pytest.raises(ValueError, match="OdometryEkf needs a gyroscope"):
        FusedOdometry(base, robot.clock, OdometryEkf())
    odometry = FusedOdometry(base, robot.clock, WheelOdometry())
    odometry.begin()
    assert odometry.pose() == base.odometry()
    odometry.end()
