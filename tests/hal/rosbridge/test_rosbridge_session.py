"""What comes over the wire is what the world is: where the base went, and what its camera and lidar see."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.robot_model.model import RobotModel
from hal.api import Camera, ForceTorque, JointGroup, Lidar, MobileBase, MotionStatus
from hal.hardware.isolated_robot import IsolatedRobot
from hal.twins.process import TwinProcess

pytestmark = pytest.mark.real_time
MAST_WEIGHT = 9.81
"""Newtons at the least: mast, head and camera weigh more than a kilogram."""


def true_place(twin: TwinProcess) -> Pose2D:
    told = twin.judge("base_pose")
    return Pose(np.array(told["position"]), np.array(told["quaternion"])).to_pose2d()


def test_it_drives_where_its_odometry_says_and_sees_the_floor_and_the_walls(
    isolated_robot: IsolatedRobot, twin_model: RobotModel, twin: TwinProcess
) -> None:
    robot = isolated_robot
    base, head = robot.part("base", MobileBase), robot.part("head", JointGroup)
    camera, lidar = robot.part("head_camera", Camera), robot.part("lidar", Lidar)
    before, true_before = base.odometry(), true_place(twin)
    first = camera.capture()
    for motion in (base.rotate(0.6), head.move_to([-0.3, 0.7])):
        while not motion.done:
            robot.clock.sleep(0.02)
        assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    robot.clock.sleep(0.3)

    moved, truly = before.inverse() @ base.odometry(), true_before.inverse() @ true_place(twin)
    assert moved.theta == pytest.approx(0.6, abs=0.01)
    assert truly.theta == pytest.approx(moved.theta, abs=0.02)

    image = camera.capture()
    assert image.stamp > first.stamp + 0.5
    assert np.mean(np.abs(image.rgb.astype(int) - first.rgb)) > 2.0
    kinematics = ForwardKinematics(twin_model)
    joints = dict(zip(head.joint_names, head.positions(), strict=True))
    points = kinematics.pose(camera.optical_frame, joints).apply(image.points()[-60:].reshape(-1, 3))
    floor = points[np.isfinite(points[:, 2]), 2]
    assert abs(np.median(floor)) < 0.01
    assert np.percentile(np.abs(floor), 90) < 0.03

    scan = lidar.scan()
    assert robot.clock.now() - scan.stamp < 0.3
    assert np.isfinite(scan.ranges).mean() > 0.5


def test_the_force_torque_sensor_feels_what_stands_on_it(isolated_robot: IsolatedRobot) -> None:
    wrench = isolated_robot.part("mast_foot", ForceTorque).wrench()
    assert abs(wrench.force[2]) > MAST_WEIGHT
    assert np.linalg.norm(wrench.force[:2]) < 0.2 * abs(wrench.force[2])
