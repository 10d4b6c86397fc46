from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.scene import semantic_map
from bestman_bt.sensing.rgbd import RGBDSensor, RGBDView
from bestman_bt.world_model import BasePose, WorldModel


@pytest.fixture(scope="module")
def sensor(robot, kinematics, joints, world) -> RGBDSensor:
    belief = WorldModel(semantic_map(world), base=BasePose(Pose2D(2.41, -0.4, 0.1), 0.01, 0.01, 0.0))
    return RGBDSensor(robot.parts["head_camera"], kinematics, joints, belief)


@pytest.fixture(scope="module")
def view(sensor) -> RGBDView:
    return sensor.capture()


def test_the_camera_pose_from_encoders_agrees_with_the_truth(sensor, truth):
    true_pose = truth.base_pose().inverse() @ truth.frame_pose(sensor.optical_frame)
    difference = sensor.base_from_camera().inverse() @ true_pose
    assert np.linalg.norm(difference.position) < 0.003
    assert 2 * math.acos(min(1.0, abs(difference.quaternion[3]))) < math.radians(0.2)


def test_the_table_top_lies_in_the_cloud_at_its_true_height(view, truth):
    height = view.cloud.points[:, 2]
    on_top = np.abs(height - 0.75) < 0.03
    assert on_top.sum() > 10_000
    assert np.median(height[on_top]) == pytest.approx(0.75, abs=0.006)


def test_the_view_in_the_map_goes_through_the_believed_pose_of_the_base(view):
    assert view.map_from_base.position[0] == 2.41
    in_map = view.map_from_base.apply(view.cloud.points)
    np.testing.assert_allclose(view.in_map.cloud().points, in_map, atol=1e-9)


def test_a_view_has_the_stamp_of_its_image(view, robot):
    assert view.stamp == pytest.approx(robot.clock.now(), abs=0.01)
