from __future__ import annotations

import numpy as np

from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.pose_estimation.yaw_profile import seen_space
from bestman_bt.perception.view import View

ORANGE, BROWN = (220, 110, 30), (140, 110, 80)
PALETTE = np.array([ORANGE]) / 255.0


def view(depth: np.ndarray, rgb: np.ndarray | None = None) -> View:
    k = CameraIntrinsics(40, 30, 40.0, 40.0, 19.5, 14.5)
    colors = np.full((30, 40, 3), BROWN, np.uint8) if rgb is None else rgb
    return View(RGBDImage(colors, depth.astype(np.float32), k, 0.0), Pose())


def excess(seen: View, u: float, v: float, depth: float) -> float:
    pixels = np.array([[u, v]])
    return float(seen_space(seen, pixels, 1, PALETTE, 0.1).excess(pixels, np.array([depth]))[0])


def test_a_sample_before_a_wall_floats_and_one_behind_it_is_hidden() -> None:
    wall = view(np.full((30, 40), 1.0))
    assert np.isclose(excess(wall, 20, 15, 0.97), 0.03)
    assert excess(wall, 20, 15, 1.05) == 0.0


def test_a_nearer_pixel_beside_a_sample_may_be_the_sample_s_own() -> None:
    depth = np.full((30, 40), 1.0)
    depth[15, 21] = 0.9
    assert excess(view(depth), 20, 15, 0.9) == 0.0
    assert excess(view(depth), 17, 15, 0.9) > 0.09


def test_where_depth_is_missing_the_model_s_colour_leaves_it_open() -> None:
    depth = np.full((30, 40), 1.0)
    depth[15, 20] = 0.0
    orange = np.full((30, 40, 3), BROWN, np.uint8)
    orange[15, 20] = ORANGE
    assert excess(view(depth, orange), 20, 15, 0.9) == 0.0
    assert np.isclose(excess(view(depth), 20, 15, 0.9), 0.1)


def test_nothing_is_said_off_the_image_and_where_nothing_was_measured() -> None:
    blind = view(np.zeros((30, 40)))
    assert excess(blind, 20, 15, 0.9) == 0.0
    assert excess(view(np.full((30, 40), 1.0)), 90, 15, 0.9) == 0.0
    assert excess(view(np.full((30, 40), np.nan)), 20, 15, 0.9) == 0.0
    lost = np.array([[np.nan, np.nan]])
    assert seen_space(blind, lost, 1, PALETTE, 0.1).excess(lost, np.array([np.nan]))[0] == 0.0
