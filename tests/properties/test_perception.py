"""What holds for grasps of measured clouds, support surfaces and hand-eye calibrations, wherever the world lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from benchmarks.rendered_table import solid
from bestman_bt.messages import Box, PlacedShape, PointCloud, Pose
from bestman_bt.perception.calibration.hand_eye import Daniilidis, ParkMartin
from bestman_bt.perception.grasp_pose.antipodal_cloud import AntipodalCloud
from bestman_bt.perception.grasp_pose.base import GraspTarget
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses
from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandSize
from bestman_bt.perception.segmentation.base import Region
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from tests.perception.calibration.recorded import errors, hand_eye_recording, turned
from tests.perception.grasp_pose.test_antipodal_cloud import GRIPPER, SUPPORT, plan, seen
from tests.perception.seen_boxes import looking_at, view_of
from tests.properties.profile import examples

seeds = st.integers(0, 10_000)
sides = st.floats(0.02, 0.3)


def moved(target, pose):
    """The world turned about the vertical and moved as a whole."""
    eyes = pose.apply(target.viewpoints)
    box = PlacedShape(target.box.shape, pose @ target.box.pose)
    return GraspTarget(box, cloud=PointCloud(pose.apply(target.cloud.points)), viewpoints=eyes)


@pytest.mark.slow
@examples(25)
@given(st.tuples(sides, sides, sides), st.integers(30, 3000), st.floats(-3.1, 3.1))
def test_no_hand_lies_inside_what_it_grasps_however_sparse_the_cloud(size, count, yaw):
    """More than noise and what pads give way; a box of 0.3 m seen at 13 mm was entered by most hands."""
    target = seen(solid("box", Box(size), (1, 1, 1), 2), noise=0.001, yaw=yaw, count=count)
    for candidate in plan(target):
        hand = HandPoses(candidate.grasp.rotation[None], candidate.grasp.position[None])
        local = target.box.pose.inverse().apply(HandShape(GRIPPER, HandSize()).outline(hand, candidate.opening))
        assert not (np.abs(local) < np.array(size) / 2 - 0.005).all(axis=1).any()


@pytest.mark.slow
@examples(10)
@given(st.tuples(st.floats(0.05, 0.15), st.floats(0.02, 0.06), st.floats(0.04, 0.12)), seeds, st.floats(-3.1, 3.1))
def test_grasps_are_as_good_wherever_the_world_lies_and_in_any_order_of_the_points(size, seed, turn):
    target = seen(solid("box", Box(size), (1, 1, 1), 2))
    best = plan(target)[0].quality
    elsewhere = moved(target, Pose.from_xyz_rpy((turn, -2.0 * turn, 0.0), (0.0, 0.0, turn)))
    mixed = np.random.default_rng(seed).permutation(target.cloud.points)
    for other in (elsewhere, GraspTarget(target.box, cloud=PointCloud(mixed), viewpoints=target.viewpoints)):
        assert plan(other)[0].quality == pytest.approx(best, abs=0.12)


@pytest.mark.slow
@examples(20)
@given(st.floats(0.3, 0.6), st.floats(0.5, 1.2), st.floats(0.3, 0.85), st.floats(0.02, 0.045), seeds)
def test_a_surface_is_found_whatever_lies_on_it(depth, width, share, thickness, seed):
    """A board of 2 cm and more on up to three quarters of it, anywhere; the world turned and moved as a whole."""
    rng = np.random.default_rng(seed)
    sizes = share * np.array([depth, width])
    offset = rng.uniform(-0.5, 0.5, 2) * (np.array([depth, width]) - sizes)
    world = Pose.from_xyz_rpy((*rng.uniform(-5, 5, 2), 0.0), (0.0, 0.0, rng.uniform(-3, 3)))
    table = PlacedShape(Box((depth, width, 0.04)), world @ Pose(np.array([0.8, 0.0, 0.73])))
    board = PlacedShape(
        Box((*sizes, thickness)), world @ Pose(np.array([0.8 + offset[0], offset[1], 0.75 + thickness / 2]))
    )
    camera = world @ looking_at((0.0, 0.1, 1.5), (0.8, 0.0, 0.75))
    region = Region(world @ Pose(np.array([0.8, 0.0, 0.76])), (depth + 0.04, width + 0.04))
    scene = PlaneDbscan().segment(view_of([table, board], camera, rng=rng), region, rng)
    middle = world.apply(np.array([0.8, 0.0, 0.0]))
    assert scene.planes[0].height_at(*middle[:2]) == pytest.approx(0.75, abs=0.003)


@pytest.mark.slow
@examples(8)
@given(seeds, st.sampled_from([ParkMartin, Daniilidis]), st.integers(0, 9), st.floats(0.02, 0.3), st.floats(0.1, 2.0))
def test_one_wrong_view_of_ten_spoils_no_calibration(seed, method, wrong, shift, turn):
    """The world turned and moved as a whole, the views in any order."""
    rng = np.random.default_rng(seed)
    truth = hand_eye_recording(seed, views=10)
    world = Pose(rng.uniform(-9, 9, 3), Rotation.random(rng=rng).as_quat())
    hands = [world @ pose for pose in truth.world_from_carrier]
    axis = rng.normal(size=3)
    hands[wrong] = hands[wrong] @ Pose(shift * axis / np.linalg.norm(axis)) @ turned(turn * rng.permutation([1, 0, 0]))
    order = rng.permutation(10)
    found = method().eye_in_hand([hands[i] for i in order], [truth.eye_from_target[i] for i in order])
    millimetres, degrees = errors(found.carrier_from_eye, truth.carrier_from_eye)
    assert [order[i] for i in found.rejected] == [wrong]
    assert millimetres < 2.5
    assert degrees < 0.3


@given(st.sampled_from([np.nan, np.inf, -np.inf]), st.floats(0.1, 1.0))
@examples(10)
def test_points_without_a_place_make_no_grasp(value, share):
    points = np.where(np.random.default_rng(1).random((200, 1)) < share, value, np.array([[0.5, 0.0, SUPPORT + 0.01]]))
    target = GraspTarget(PlacedShape(Box((0.1, 0.1, 0.1)), Pose()), cloud=PointCloud(points))
    assert AntipodalCloud().plan(target, GRIPPER, SUPPORT) == ()
