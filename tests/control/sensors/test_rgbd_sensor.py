from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.control.rgbd import RGBDSensor, RGBDView
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D, RGBDImage
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.world_model import BasePose, HeldObject, WorldModel


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
    assert 0.0 <= robot.clock.now() - view.stamp <= 0.05 + 1 / 30 + 0.01, "a latency and a frame"


def test_what_is_held_is_part_of_the_robot_and_left_out_of_views_where_it_is(robot, model, kinematics, joints, world):
    camera = robot.parts["head_camera"]
    tool = kinematics.pose(model.of(ArmModel)["arm"].tool_frame, joints.positions())
    eye = kinematics.pose(camera.optical_frame, joints.positions())
    # Beside the hand, in the middle of the picture and 1.2 m away: no link of the robot is there.
    middle = eye @ Pose(np.array([0.0, 0.0, 1.2]))
    box = ObjectModel("box", (1.0, 0.0, 0.0), 0.1, 0.5, (PlacedShape(Box((0.1, 0.1, 0.1)), Pose()),))
    seen = camera.capture()
    for gap, own in ((0.09, True), (0.11, False)):
        depth = np.full_like(seen.depth, 1.2 + gap)
        image = RGBDImage(seen.rgb, depth, seen.intrinsics, seen.stamp)
        still = SimpleNamespace(
            name=camera.name,
            intrinsics=camera.intrinsics,
            optical_frame=camera.optical_frame,
            capture=lambda image=image: image,
        )
        for held in (None, HeldObject("box", box, tool.inverse() @ middle, 0.1)):
            belief = WorldModel(semantic_map(world), hands={} if held is None else {"arm": held})
            view = RGBDSensor(still, kinematics, joints, belief).capture()
            row, column = round(seen.intrinsics.cy), round(seen.intrinsics.cx)
            assert view.own_body[row, column] == (held is not None and own)
            known = view.in_base.image.depth[row, column]
            assert (known == 0.0) == (held is not None and own)
            assert view.image.depth[row, column] > 1.0
            assert not view.own_body[row, column + 150]
