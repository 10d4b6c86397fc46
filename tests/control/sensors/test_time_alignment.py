"""Images and scans are up to 0.14 s old; what they show is placed where the robot stood when they were taken."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.history import NotRecordedError
from bestman_bt.control.rgbd import CameraError, CameraErrorCode, RGBDSensor
from bestman_bt.messages import Pose, Pose2D
from hal.api import NoDataError


@pytest.fixture
def turning(simulate):
    """A base that turns by 0.6 rad, its head too; yields the rig, its camera's views and scans, and the true poses."""
    it = simulate(3)
    it.joints.start(it.robot.clock)
    sensor = RGBDSensor(
        it.robot.parts["head_camera"], it.kinematics, it.joints, it.world, it.robot.clock, it.base.pose_at
    )
    views, scans, truth = [], [], []

    def note() -> None:
        truth.append((it.robot.clock.now(), it.truth.frame_pose(sensor.optical_frame), it.true_pose))

    motion = it.base.turn(0.6)
    head = it.robot.parts["head"]
    head.move_to(head.positions() + np.array([0.4, 0.0]))
    while not motion.done:
        it.robot.clock.sleep(1.0 / 240.0)
        note()
        if len(truth) % 60 == 0:
            views.append(sensor.capture())
            scans.append(it.base.last_scan)
    return it, views, scans, truth


def _at(truth, stamp: float) -> tuple[Pose, Pose]:
    _, camera, base = min(truth, key=lambda entry: abs(entry[0] - stamp))
    return camera, base.to_pose()


def test_what_a_turning_robot_sees_lies_where_it_is(turning) -> None:
    it, views, scans, truth = turning
    checked = [view for view in views if view.stamp > truth[0][0]]
    assert len(checked) > 5
    off, unaligned = [], []
    for view in checked:
        camera, base = _at(truth, view.stamp)
        ahead = np.array([[0.0, 0.0, 1.0]])  # a point 1 m before the camera
        # The belief errs by a few millimetres even at rest: both are compared in the base frame of the stamp.
        seen = (view.base_from_camera).apply(ahead)
        off.append(float(np.linalg.norm(seen - (base.inverse() @ camera).apply(ahead))))
        off.append(0.5 * abs(math.remainder(view.map_from_base.yaw - base.yaw, 2 * math.pi)))
        late, _ = _at(truth, view.stamp + 0.08)
        unaligned.append(float(np.linalg.norm(late.apply(ahead) - camera.apply(ahead))))
    assert max(unaligned) > 0.05, "the robot turns fast enough for the test to tell"
    assert max(off) < 0.015
    lidar = it.base.lidar.base_from_lidar
    for seen in scans:
        if seen.scan.stamp > truth[0][0]:
            _, base = _at(truth, seen.scan.stamp)
            assert seen.map_from_lidar.theta == pytest.approx((base.to_pose2d() @ lidar).theta, abs=math.radians(1.0))


def silent() -> Pose2D:
    raise NoDataError("no odometry")


def test_an_image_of_a_time_that_nothing_tells_of_is_none(simulate, monkeypatch) -> None:
    it = simulate(2)
    it.joints.start(it.robot.clock)
    it.robot.clock.sleep(3.0)
    with pytest.raises(NotRecordedError, match="before the oldest"):
        it.joints.at(it.robot.clock.now() - 2.5)
    camera = it.robot.parts["head_camera"]
    sensor = RGBDSensor(camera, it.kinematics, it.joints, it.world, None, it.base.pose_at)
    sensor.capture()
    it.joints.close()
    it.joints.start(it.robot.clock)
    it.base.close()
    it.base.localisation.begin()
    it.robot.clock.sleep(1.0)
    assert sensor.capture().stamp > it.robot.clock.now() - 0.2, "held up for a second, it reads the odometry"
    it.base.localisation.begin()
    it.robot.clock.sleep(1.0)
    monkeypatch.setattr(it.base.localisation.odometer, "pose", silent)
    with pytest.raises(CameraError, match="the pose of the robot is unknown for the image of head_camera") as error:
        sensor.capture()
    assert error.value.code is CameraErrorCode.STALE
    it.joints.close()
    assert it.joints.at(0.0) == it.joints.positions(), "of now where nothing is recorded"
