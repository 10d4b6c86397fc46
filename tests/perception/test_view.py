from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.view import View


@pytest.fixture
def view() -> View:
    rng = np.random.default_rng(0)
    k = CameraIntrinsics(64, 48, 60.0, 55.0, 31.0, 24.5)
    depth = rng.uniform(0.5, 2.0, (48, 64)).astype(np.float32)
    depth[10, 20], depth[3, 4] = 0.0, np.nan
    image = RGBDImage(rng.integers(0, 255, (48, 64, 3)), depth, k, 0.0)
    return View(image, Pose.from_xyz_rpy((0.3, -0.2, 1.5), (-2.2, 0.1, -1.4)))


def test_the_cloud_is_the_image_s_points_moved_into_the_frame(view: View) -> None:
    organised = view.frame_from_camera.apply(view.image.points())
    known = np.isfinite(organised).all(axis=2)
    assert known.sum() == 48 * 64 - 2
    np.testing.assert_allclose(view.cloud().points, organised[known], atol=1e-12)
    np.testing.assert_array_equal(view.cloud().colors, view.image.rgb[known])


def test_a_window_around_a_body_keeps_all_points_of_it(view: View) -> None:
    points = view.cloud().points
    centre = points[1500]
    corners = centre + 0.1 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    near = (np.abs(points - centre) < 0.1).all(axis=1)
    window = view.cloud(corners).points
    assert len(window) < len(points)
    kept = {tuple(point) for point in window.round(9)}
    assert {tuple(point) for point in points[near].round(9)} <= kept


def test_a_window_reaches_up_to_the_pixels_that_show_the_corners_of_the_body(view: View) -> None:
    k = view.image.intrinsics
    low, high = np.array([20.0, 12.0]), np.array([40.0, 30.0])
    rays = [[(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0] for u in (low[0], high[0]) for v in (low[1], high[1])]
    for depth in (0.7, 1.3):
        corners = view.frame_from_camera.apply(depth * np.array(rays))
        _, _, (rows, columns) = view.organised(corners)
        assert rows.start <= 12 < 30 < rows.stop <= 33
        assert columns.start <= 20 < 40 < columns.stop <= 43


def test_projection_undoes_the_cloud(view: View) -> None:
    points = view.cloud().points
    pixels, depth = view.project(points)
    np.testing.assert_allclose(view.measured_depth(pixels), depth, rtol=1e-6)


def test_depth_is_unknown_off_the_image_and_behind_the_camera(view: View) -> None:
    behind = view.frame_from_camera.apply(np.array([[0.0, 0.0, -1.0], [50.0, 0.0, 1.0]]))
    pixels, _ = view.project(behind)
    assert np.isnan(view.measured_depth(pixels)).all()


def test_another_frame_shows_the_same_points(view: View) -> None:
    other_from_frame = Pose.from_xyz_rpy((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    moved = view.seen_from(other_from_frame).cloud().points
    np.testing.assert_allclose(moved, other_from_frame.apply(view.cloud().points), atol=1e-12)


def test_the_organised_points_are_the_cloud_with_unknown_pixels_in_their_places(view: View) -> None:
    points, depth, (rows, columns) = view.organised()
    assert (rows, columns) == (slice(0, 48), slice(0, 64))
    known = np.isfinite(points).all(axis=2)
    np.testing.assert_array_equal(known, depth > 0)
    np.testing.assert_allclose(points[known], view.cloud().points, atol=1e-12)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0, 0.0])
def test_depths_that_are_no_distances_are_unknown_everywhere(value: float) -> None:
    k = CameraIntrinsics(4, 3, 10.0, 10.0, 2.0, 1.0)
    depth = np.ones((3, 4), np.float32)
    depth[1, 2] = value
    odd = View(RGBDImage(np.zeros((3, 4, 3), np.uint8), depth, k, 0.0), Pose())
    assert len(odd.cloud()) == 11
    assert np.isnan(odd.organised()[0][1, 2]).all()
    assert odd.organised()[1][1, 2] == 0.0
    assert np.isnan(odd.measured_depth(np.array([[2.0, 1.0]]))).all()


@pytest.mark.parametrize(
    ("intrinsics", "message"),
    [
        (CameraIntrinsics(4, 3, 10.0, 10.0, 2.0, 1.0, (0.1, 0.0, 0.0, 0.0)), "lens distortion .*; rectify it first"),
        (CameraIntrinsics(4, 3, 0.0, 10.0, 2.0, 1.0), "focal lengths should be above 0 but are 0.0, 10.0"),
        (CameraIntrinsics(4, 3, 10.0, float("nan"), 2.0, 1.0), "focal lengths should be above 0"),
    ],
)
def test_images_of_no_ideal_pinhole_are_refused_in_words(intrinsics: CameraIntrinsics, message: str) -> None:
    image = RGBDImage(np.zeros((3, 4, 3), np.uint8), np.ones((3, 4), np.float32), intrinsics, 0.0)
    with pytest.raises(PerceptionError, match=message):
        View(image, Pose())
