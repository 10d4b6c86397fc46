"""Images of a lens become those of a pinhole; the systematic error of depth is taken away."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.camera_model import DepthCorrection, Rectification, rectification
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.view import View

LENS = CameraIntrinsics(320, 240, 210.0, 214.0, 161.0, 118.0, (-0.3, 0.1, 0.001, -0.002, 0.0))


def drawn_through_the_lens(points: np.ndarray) -> RGBDImage:
    """White dots where the lens shows points (N, 3) of the optical frame; depth in steps from left to right."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), LENS.matrix, np.array(LENS.distortion))
    rgb = np.zeros((240, 320, 3), dtype=np.uint8)
    for u, v in pixels.reshape(-1, 2):
        cv2.circle(rgb, (round(8 * u), round(8 * v)), 24, (255, 255, 255), -1, cv2.LINE_AA, 3)
    depth = np.where(np.arange(320) < 160, 1.0, 2.0).astype(np.float32) * np.ones((240, 1), dtype=np.float32)
    return RGBDImage(rgb, depth, LENS, 3.0)


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, 5), np.linspace(-0.45, 0.45, 4))
    return np.stack([x.ravel(), y.ravel(), np.ones(20)], axis=1)


def test_what_was_bent_stands_where_a_pinhole_sees_it(points):
    rectify = rectification(LENS)
    assert rectify is not None
    image = rectify.apply(drawn_through_the_lens(points))
    assert image.intrinsics == replace(LENS, distortion=())
    expected = points[:, :2] * (LENS.fx, LENS.fy) + (LENS.cx, LENS.cy)
    count, _, _, centres = cv2.connectedComponentsWithStats((image.rgb[..., 0] > 100).astype(np.uint8))
    assert count == 21
    nearest = np.linalg.norm(centres[1:, None] - expected[None], axis=2).min(axis=1)
    assert nearest.max() < 0.5


def test_depths_are_never_mixed_across_an_edge(points):
    image = rectification(LENS).apply(drawn_through_the_lens(points))
    assert set(np.unique(image.depth)) <= {np.float32(0.0), np.float32(1.0), np.float32(2.0)}


def test_the_map_is_made_once_and_not_at_all_for_a_pinhole():
    assert rectification(LENS) is rectification(replace(LENS))
    assert rectification(replace(LENS, distortion=())) is None
    assert rectification(replace(LENS, distortion=(0.0, 0.0, 0.0, 0.0))) is None


def test_an_image_of_another_camera_is_refused(points):
    other = Rectification(replace(LENS, fx=300.0))
    with pytest.raises(PerceptionError, match="cannot be rectified"):
        other.apply(drawn_through_the_lens(points))


def test_points_of_a_bent_image_are_refused(points):
    with pytest.raises(ValueError, match="rectify it before computing points"):
        drawn_through_the_lens(points).points()
    with pytest.raises(PerceptionError, match="rectify it first"):
        View(drawn_through_the_lens(points), Pose())


def test_three_coefficients_are_no_lens():
    with pytest.raises(ValueError, match="k1, k2, p1, p2"):
        replace(LENS, distortion=(0.1, 0.2, 0.3))


def test_told_depths_become_true_ones_and_holes_stay_holes():
    true = np.array([[0.5, 1.0, 3.0]], dtype=np.float32)
    told = np.where(true > 0, 1.03 * true - 0.01, 0).astype(np.float32)
    assert DepthCorrection(1.03, -0.01).apply(told) == pytest.approx(true, abs=1e-6)
    holes = np.array([[0.0, 0.004]], dtype=np.float32)
    assert (DepthCorrection(1.0, 0.01).apply(holes) == 0).all()
