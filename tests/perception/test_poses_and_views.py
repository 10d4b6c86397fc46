"""Projection, planes, yaws and covariances, on numbers that can be worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, CameraIntrinsics, Cylinder, ObjectModel, PlacedShape, PointCloud, Pose, RGBDImage
from bestman_bt.perception.camera_model import DepthCorrection
from bestman_bt.perception.pose_estimation.evidence import ConfidenceModel, PoseEvidence
from bestman_bt.perception.pose_estimation.model_surface import model_surface
from bestman_bt.perception.pose_estimation.multi_start import covariance_in_frame
from bestman_bt.perception.pose_estimation.multi_view import pooled
from bestman_bt.perception.pose_estimation.point_to_plane import into_model
from bestman_bt.perception.pose_estimation.registration import Registration, end_aligned_poses, yaw_difference
from bestman_bt.perception.pose_estimation.yaw_profile import YawProfile
from bestman_bt.perception.segmentation.base import Cluster, SupportPlane, voxel_means
from bestman_bt.perception.segmentation.horizontal_plane import least_squares_plane, rectangle
from bestman_bt.perception.segmentation.plane_dbscan import dbscan
from bestman_bt.perception.view import View, known_depth

CAMERA = CameraIntrinsics(8, 6, 10.0, 20.0, 3.0, 2.0)
PLACED = Pose.from_xyz_rpy((1.0, 2.0, 3.0), (0.4, -0.3, 2.0))


def view(depth: np.ndarray, pose: Pose = PLACED) -> View:
    rgb = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)
    return View(RGBDImage(rgb, depth.astype(np.float32), CAMERA, 0.0), pose)


def test_measured_points_project_back_onto_their_pixels_with_their_depth_and_colour() -> None:
    depth = np.random.default_rng(0).uniform(0.5, 2.0, (6, 8))
    depth[[0, 2, 4], [1, 5, 7]] = (0.0, np.nan, -1.0)
    seen = view(depth)
    cloud = seen.cloud()
    points, depths, _ = seen.organised()
    assert len(cloud) == 45
    pixels, z = seen.project(cloud.points)
    u, v = np.rint(pixels).astype(int).T
    assert pixels == pytest.approx(np.column_stack([u, v]), abs=1e-5)
    assert z == pytest.approx(depth[v, u], abs=1e-5)
    assert np.array_equal(cloud.colors, seen.image.rgb[v, u])
    assert np.isnan(points[2, 5]).all()
    assert (depths[[0, 2, 4], [1, 5, 7]] == 0.0).all()
    assert seen.measured_depth(np.array([[1.4, -0.4], [5.0, 2.0], [7.4, 5.4]])) == pytest.approx(
        [np.nan, np.nan, depth[5, 7]], nan_ok=True
    )


@pytest.mark.parametrize("pixel", [(-0.6, 0.0), (0.0, -0.6), (7.6, 0.0), (0.0, 5.6), (np.nan, 1.0)])
def test_beyond_the_border_nothing_is_measured(pixel: tuple[float, float]) -> None:
    assert np.isnan(view(np.ones((6, 8))).measured_depth(np.array([pixel])))[0]


def test_what_lies_behind_the_camera_has_no_pixel() -> None:
    pixels, depth = view(np.ones((6, 8))).project(PLACED.apply(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])))
    assert np.isnan(pixels[0]).all()
    assert np.isnan(depth[0])
    assert pixels[1] == pytest.approx([3.0, 2.0])


def test_only_the_part_around_a_body_is_taken_and_all_where_it_reaches_behind_the_camera() -> None:
    seen = view(np.ones((6, 8)))
    corners = PLACED.apply(np.array([[x, y, 1.0] for x in (-0.05, 0.15) for y in (-0.02, 0.06)]))
    _, depth, (rows, columns) = seen.organised(corners)
    assert (rows, columns) == (slice(1, 5), slice(2, 6))
    assert depth.shape == (4, 4)
    behind = np.concatenate([corners, PLACED.apply(np.array([[0.0, 0.0, -1.0]]))])
    assert len(seen.cloud(behind)) == 48


def test_a_view_given_in_another_frame_is_the_same_view() -> None:
    other = Pose.from_xyz_rpy((0.5, -1.0, 0.2), (0.0, 0.0, 1.1))
    seen = view(np.full((6, 8), 1.3))
    assert seen.seen_from(other).cloud().points == pytest.approx(other.apply(seen.cloud().points))
    assert seen.seen_from(other).viewpoint == pytest.approx(other.apply(PLACED.position[None])[0])


def test_unknown_depths_are_nothing() -> None:
    told = np.array([[0.0, -1.0, np.nan, np.inf, 2.0]], dtype=np.float32)
    assert known_depth(told).tolist() == [[0.0, 0.0, 0.0, 0.0, 2.0]]
    assert DepthCorrection(2.0, 0.5).apply(np.array([[0.4, 0.5, 2.5]], np.float32)).tolist() == [[0.0, 0.0, 1.0]]


TILTED = SupportPlane(
    Pose.from_xyz_rpy((1.0, -0.5, 0.7), (0.0, 0.0, 0.8)) @ Pose.from_xyz_rpy((0, 0, 0), (0.05, -0.03, 0.0)),
    (0.4, 0.6),
    np.zeros((3, 3)),
    0.001,
)


def test_heights_are_told_along_the_normal_and_below_a_place_of_the_frame() -> None:
    local = np.array([[0.1, 0.2, 0.05], [-0.2, 0.3, -0.02], [0.0, 0.0, 0.0]])
    points = TILTED.frame_from_plane.apply(local)
    assert TILTED.heights(points) == pytest.approx(local[:, 2])
    on_plane = TILTED.frame_from_plane.apply(np.array([[0.15, -0.1, 0.0]]))[0]
    assert TILTED.height_at(*on_plane[:2]) == pytest.approx(on_plane[2])
    assert TILTED.tilt == pytest.approx(math.acos(math.cos(0.05) * math.cos(0.03)))
    moved = Pose.from_xyz_rpy((2.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert TILTED.seen_from(moved).heights(moved.apply(points)) == pytest.approx(local[:, 2])


def test_a_slab_lies_below_its_surface_and_an_obstacle_is_grown_upwards_and_sideways() -> None:
    slab = TILTED.slab(0.03, grow=0.01)
    assert slab.shape.size == pytest.approx((0.42, 0.62, 0.03))
    assert TILTED.heights(slab.pose.position[None]) == pytest.approx([-0.015])
    x, y, z = np.meshgrid(np.linspace(0, 0.1, 6), np.linspace(0, 0.04, 6), np.linspace(0, 0.2, 101))
    points = TILTED.frame_from_plane.apply(np.column_stack([x.ravel(), y.ravel(), z.ravel()]))
    cluster = Cluster(points, np.zeros((len(points), 3), np.uint8), TILTED)
    box, grown = cluster.bounding_box, cluster.obstacle(0.02)
    assert sorted(box.shape.size) == pytest.approx([0.04, 0.1, 0.198], abs=2e-3)
    assert np.array(grown.shape.size) - box.shape.size == pytest.approx([0.04, 0.04, 0.02])
    bottom = grown.pose.apply(np.array([[0.0, 0.0, -grown.shape.size[2] / 2]]))
    assert TILTED.heights(bottom) == pytest.approx([0.0], abs=1e-6)


def test_the_rectangle_of_a_surface_has_its_turn_its_size_and_its_middle() -> None:
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 41), np.linspace(-0.2, 0.2, 31))
    turned = Pose.from_xyz_rpy((0.5, 0.1, 0.0), (0.0, 0.0, math.radians(4.0)))
    flat = turned.apply(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))
    points = flat + np.column_stack([np.zeros((len(flat), 2)), 0.02 * flat[:, 0] - 0.03 * flat[:, 1] + 0.7])
    plane = least_squares_plane(points)
    assert plane == pytest.approx([0.02, -0.03, 0.7])
    pose, size = rectangle(points, plane)
    assert size == pytest.approx((0.6, 0.4), abs=1e-3)
    assert pose.position == pytest.approx([0.5, 0.1, 0.7 + 0.01 - 0.003], abs=1e-3)
    assert math.atan2(pose.rotation[1, 0], pose.rotation[0, 0]) == pytest.approx(math.radians(4.0), abs=1e-3)
    assert pose.rotation[:, 2] == pytest.approx(np.array([-0.02, 0.03, 1.0]) / np.linalg.norm([-0.02, 0.03, 1.0]))


def test_clusters_are_linked_by_cores_and_lone_points_are_noise() -> None:
    """Two rows of points a centimetre apart, 5 cm from each other, and a stray one."""
    row = np.column_stack([np.arange(8) * 0.01, np.zeros(8), np.zeros(8)])
    points = np.concatenate([row, row + np.array([0.0, 0.05, 0.0]), [[0.5, 0.5, 0.5]]])
    labels = dbscan(points, 0.021, 3)
    assert labels.tolist() == [0] * 8 + [1] * 8 + [-1]
    assert set(dbscan(points[:8], 0.021, 6).tolist()) == {-1}


def test_voxels_keep_the_mean_of_places_and_colours() -> None:
    cloud = PointCloud(
        np.array([[0.0, 0, 0], [0.003, 0, 0], [0.0101, 0, 0]]), np.array([[0, 0, 0], [100, 0, 0], [7, 8, 9]], np.uint8)
    )
    thin = voxel_means(cloud, 0.005)
    assert thin.points == pytest.approx(np.array([[0.0015, 0, 0], [0.0101, 0, 0]]))
    assert thin.colors.tolist() == [[50, 0, 0], [7, 8, 9]]


@pytest.mark.parametrize(
    ("angle", "turns", "expected"),
    [(3.3, 0, 0.0), (3.3, 1, 2 * math.pi - 3.3), (-0.2, 1, 0.2), (3.3, 2, 3.3 - math.pi), (1.5, 4, math.pi / 2 - 1.5)],
)
def test_yaws_differ_modulo_the_symmetry(angle: float, turns: int, expected: float) -> None:
    assert yaw_difference(angle, turns) == pytest.approx(expected)


def test_points_are_moved_into_the_frame_of_a_standing_model() -> None:
    pose = np.array([0.3, -0.2, 1.1])
    points = np.random.default_rng(0).normal(size=(5, 3))
    expected = Pose.from_xyz_rpy((0.3, -0.2, 0.0), (0.0, 0.0, 1.1)).inverse().apply(points)
    assert into_model(points, pose[None])[0] == pytest.approx(expected)


def test_noise_grows_with_the_square_of_the_distance_beyond_forty_centimetres() -> None:
    p = Registration()
    for distance, noise in ((0.3, 0.0012), (0.4, 0.0012), (1.4, 0.0031)):
        assert p.depth_noise(np.zeros((1, 3)), np.array([0.0, distance, 0.0])) == pytest.approx(noise)


BRICK = ObjectModel("brick", (1, 0, 0), 0.3, 0.6, (PlacedShape(Box((0.12, 0.06, 0.08)), Pose()),), symmetry_order=2)
CAN = ObjectModel("can", (1, 0, 0), 0.3, 0.6, (PlacedShape(Cylinder(0.04, 0.1), Pose()),), symmetry_order=0)
EYE = np.array([-0.8, 0.1, 0.7])


def visible(model: ObjectModel, pose: np.ndarray) -> np.ndarray:
    """Samples of a standing model that face the camera, in the plane's frame."""
    surface = model_surface(model, Pose(), 0.004)
    placed = Pose.from_xyz_rpy((pose[0], pose[1], 0.0), (0.0, 0.0, pose[2]))
    points, normals = placed.apply(surface.points), surface.normals @ placed.rotation.T
    return points[((EYE - points) * normals).sum(axis=1) > 0.0]


@pytest.mark.parametrize("yaw", [0.5, -2.0, 3.0])
def test_a_fit_starts_nearby_and_ends_at_the_true_pose(yaw: float) -> None:
    true = np.array([0.1, -0.05, yaw])
    surface, points = model_surface(BRICK, Pose(), 0.003), visible(BRICK, true)
    fit = Registration().refined_fit(surface, points, EYE, true + np.array([0.008, -0.006, 0.1]), 2)
    assert fit.pose == pytest.approx(true, abs=0.002)
    assert np.abs(fit.residuals).max() < 0.004
    assert fit.frame_from_object(Pose(np.array([0, 0, 0.7])), surface).position == pytest.approx(
        [*true[:2], 0.74], abs=2e-3
    )
    worse = Registration().fit_at(surface, points, EYE, true + np.array([0.01, 0.0, 0.0]), 2)
    assert worse.pose == pytest.approx(true + np.array([0.01, 0.0, 0.0]))
    assert np.sqrt(np.mean(worse.residuals**2)) > 2 * np.sqrt(np.mean(fit.residuals**2))
    assert np.trace(worse.covariance[:2, :2]) > np.trace(fit.covariance[:2, :2])


def test_a_body_of_revolution_has_no_yaw_and_a_floor_under_its_errors() -> None:
    p = Registration()
    fit = p.refined_fit(model_surface(CAN, Pose(), 0.003), visible(CAN, np.zeros(3)), EYE, np.array([0.005, 0, 0]), 0)
    assert fit.yaw_std == pytest.approx(math.pi)
    assert fit.covariance[2, :2] == pytest.approx([0.0, 0.0])
    assert fit.covariance[0, 0] >= p.position_floor**2
    asymmetric = p.fit_at(model_surface(BRICK, Pose(), 0.003), visible(BRICK, np.zeros(3)), EYE, np.zeros(3), 1)
    assert asymmetric.yaw_std >= p.asymmetric_yaw_floor


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2])
def test_a_half_hidden_model_is_tried_with_its_ends_where_the_points_end(yaw: float) -> None:
    """Of a brick of 12 cm the last 4 cm at one end are hidden: 2 cm more to one side, or to the other."""
    surface = model_surface(BRICK, Pose(), 0.003)
    shown = surface.points[surface.points[:, 0] < 0.02]
    placed = Pose.from_xyz_rpy((0.2, 0.1, 0.0), (0.0, 0.0, yaw))
    start = np.array([*placed.apply(np.array([[-0.02, 0.0, 0.0]]))[0, :2], yaw])
    options = end_aligned_poses(surface, placed.apply(shown), start, 0.008)
    offsets = sorted(
        float(into_model(np.array([[*o[:2], 0.0]]), np.array([[0.2, 0.1, yaw]]))[0, 0, 0]) for o in options
    )
    assert len(options) == 2
    assert offsets == pytest.approx([-0.04, 0.0], abs=0.004)
    assert all(option[2] == yaw for option in options)


def profile(values: list[float]) -> YawProfile:
    count = len(values)
    yaws = np.arange(count) * (2 * math.pi / count)
    return YawProfile(yaws, np.column_stack([yaws, -yaws]), np.array(values))


FLAT = [-100.0] * 24


def test_yaws_stay_open_within_the_margin_across_the_end_of_the_circle_too() -> None:
    values = FLAT.copy()
    values[23], values[0], values[1], values[10] = -15.0, 0.0, -16.0, -17.0
    step = math.radians(15.0)
    (arc,) = profile(values).plausible_yaws(16.0, 0.0, 0.0).arcs
    assert arc[0] == pytest.approx(0.0)
    assert arc[1] == pytest.approx(1.5 * step)
    values[10] = -16.0
    first, second = profile(values).plausible_yaws(16.0, math.radians(150.0), 0.01).arcs
    assert first[0] == pytest.approx(math.radians(150.0))
    assert first[1] == pytest.approx(0.5 * step + 0.01)
    assert second == pytest.approx((0.0, 1.5 * step))


def test_a_gap_of_one_yaw_is_closed_and_one_of_two_is_not() -> None:
    for gap, count in ((1, 1), (2, 2)):
        values = FLAT.copy()
        for k in range(7):
            values[(k - 3) % 24] = 0.0
        for k in range(gap):
            values[k] = -50.0
        assert len(profile(values).plausible_yaws(16.0, -0.3, 0.0).arcs) == count
    assert profile([0.0] * 24).plausible_yaws(16.0, 1.0, 0.1).arcs == ((1.0, math.pi),)


def test_starts_are_the_peaks_within_the_margin_the_best_first() -> None:
    values = FLAT.copy()
    values[3], values[4], values[12], values[20] = -5.0, 0.0, -10.0, -20.0
    found = profile(values).starts(16.0, 5)
    assert [round(math.degrees(start[2])) for start in found] == [60, 180]
    assert found[0][:2] == pytest.approx([found[0][2], -found[0][2]])
    assert len(profile(values).starts(16.0, 1)) == 1


def test_a_covariance_on_a_plane_is_turned_into_the_frame() -> None:
    planar = np.diag([0.004, 0.001, 0.02]) ** 2
    turned = covariance_in_frame(planar, Pose.from_xyz_rpy((1.0, 2.0, 0.5), (0.0, 0.0, math.pi / 2)))
    assert np.sqrt(np.diag(turned))[[0, 1, 5]] == pytest.approx([0.001, 0.004, 0.02])
    planar[0, 2] = planar[2, 0] = 1e-5
    assert covariance_in_frame(planar, Pose.from_xyz_rpy((0, 0, 0), (0, 0, math.pi)))[0, 5] == pytest.approx(-1e-5)
    slanted = covariance_in_frame(planar, Pose.from_xyz_rpy((0, 0, 0), (0, 0, math.pi / 6)))
    assert slanted[0, 1] == pytest.approx((0.004**2 - 0.001**2) * math.sin(math.pi / 3) / 2)


def test_evidence_of_several_views_is_weighed_and_each_part_of_it_counts() -> None:
    good, bad = PoseEvidence(0.001, 1.0, 1.0, 0.0, 0.0, 0.002), PoseEvidence(0.003, 0.6, 0.5, 0.2, 0.4, 0.004)
    mean = pooled([good, bad], np.array([0.75, 0.25]))
    assert mean.rmse == pytest.approx(math.sqrt(0.75 * 1e-6 + 0.25 * 9e-6))
    assert (mean.explained, mean.visible_fraction, mean.floating) == pytest.approx((0.9, 0.875, 0.05))
    assert (mean.outside, mean.noise) == pytest.approx((0.1, 0.0025))
    model = ConfidenceModel()
    assert model.logit(good, 0.0) == model.bias
    parts = [
        (PoseEvidence(0.001, 0.99, 1.0, 0.0, 0.0, 0.002), 0.0, -1.6),
        (PoseEvidence(0.001, 1.0, 0.9, 0.0, 0.0, 0.002), 0.0, -0.3),
        (PoseEvidence(0.001, 1.0, 1.0, 0.02, 0.0, 0.002), 0.0, -1.0),
        (PoseEvidence(0.001, 1.0, 1.0, 0.0, 0.1, 0.002), 0.0, -0.5),
        (PoseEvidence(0.003, 1.0, 1.0, 0.0, 0.0, 0.002), 0.0, -1.5),
        (good, 0.1, -3.0),
    ]
    for evidence, color, loss in parts:
        assert model.logit(evidence, color) - model.bias == pytest.approx(loss)
