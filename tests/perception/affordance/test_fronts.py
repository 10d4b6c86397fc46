from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.perception_measures.distractors import Parts, block
from benchmarks.rendering import render_view
from bestman_bt.messages import Pose
from bestman_bt.perception.affordance.fronts import FrontPlane, FrontSearch
from bestman_bt.perception.affordance.rectified import relief

CameraBefore = Callable[[np.ndarray, float, float, float], Pose]
GREY = (0.6, 0.6, 0.6)


def fronts_of(parts: Parts, pose: Pose) -> list[FrontPlane]:
    return FrontSearch().find(render_view(parts, pose, np.random.default_rng(0)))


def test_two_fronts_that_lie_20_millimetres_apart_in_depth_are_two(camera: CameraBefore) -> None:
    parts = block((0.0, -0.5, 0.0), (0.4, 0.0, 0.8), GREY) + block((0.02, 0.0, 0.0), (0.4, 0.5, 0.8), GREY)
    fronts = fronts_of(parts, camera(np.array([0.0, 0.0, 0.4]), 1.5, 15.0, 15.0))
    facing = [front for front in fronts if front.frame_from_front.rotation[0, 2] < -0.99]
    near, far = sorted(float(front.frame_from_front.position[0]) for front in facing)
    assert near == pytest.approx(0.0, abs=0.002)
    assert far == pytest.approx(0.02, abs=0.002)


def test_axes_of_a_front_are_right_up_and_out(camera: CameraBefore) -> None:
    (front,) = fronts_of(
        block((0.0, -0.5, 0.2), (0.4, 0.5, 0.8), GREY), camera(np.array([0.0, 0.0, 0.5]), 1.4, 0.0, 0.0)
    )
    expected = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(front.frame_from_front.rotation, expected, atol=0.01)
    np.testing.assert_allclose(front.high - front.low, [1.0, 0.6], atol=0.06)
    assert abs(front.frame_from_front.position[0]) < 0.002


def test_floors_and_table_tops_are_no_fronts(camera: CameraBefore) -> None:
    parts = block((-3.0, -3.0, -0.02), (3.0, 3.0, 0.0), GREY)
    assert fronts_of(parts, camera(np.array([0.0, 0.0, 0.0]), 1.5, 0.0, 40.0)) == []


def test_the_relief_measures_heights_before_a_front_and_where_rays_meet_it(camera: CameraBefore) -> None:
    parts = block((0.0, -0.6, 0.0), (0.4, 0.6, 1.0), GREY) + block((-0.04, 0.1, 0.5), (0.0, 0.2, 0.6), GREY)
    view = render_view(parts, camera(np.array([0.0, 0.0, 0.5]), 1.2, 20.0, 10.0), np.random.default_rng(0))
    front = max(FrontSearch().find(view), key=lambda one: one.area)
    around = relief(view, front, FrontSearch())
    box_middle = front.frame_from_front.inverse().apply(np.array([[-0.04, 0.15, 0.55]]))[0]
    rows, columns = around.window(box_middle[:2] - 0.03, box_middle[:2] + 0.03, 0.04)
    assert float(np.nanmedian(around.height[rows, columns])) == pytest.approx(0.04, abs=0.002)
    inner = np.meshgrid(np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop), indexing="ij")
    met = around.on_level((inner[0].ravel(), inner[1].ravel()), 0.04).mean(axis=0)
    np.testing.assert_allclose(met, box_middle[:2], atol=0.004)
    assert around.pixel_size() == pytest.approx(1.2 / (240 / math.tan(math.radians(29.0))), rel=0.1)
