from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.pose_estimation.model_surface import model_surface
from bestman_bt.perception.pose_estimation.point_to_plane import (
    YawObservability,
    slide,
    surface_distances,
    yaw_observability,
)
from bestman_bt.scene.object_file import read_object


@pytest.fixture(scope="module")
def mug() -> YawObservability:
    return yaw_observability(model_surface(read_object("mug"), Pose(), 0.003))


def handle(mug: YawObservability) -> np.ndarray:
    """The body is a lathe part of radius 40 mm about an axis 15 mm beside the origin."""
    return np.hypot(mug.surface.points[:, 0] + 0.015, mug.surface.points[:, 1]) > 0.045


def test_only_the_handle_of_a_mug_reports_its_yaw(mug: YawObservability) -> None:
    assert mug.largest_distances[handle(mug)].min() > 0.004
    assert np.percentile(mug.largest_distances[handle(mug)], 20) > 0.01
    assert np.percentile(mug.largest_distances[~handle(mug)], 90) < 0.005


def test_a_turned_mug_is_moved_until_its_body_is_where_it_was(mug: YawObservability) -> None:
    half_turn = mug.shift(np.array([math.pi]))[0]
    np.testing.assert_allclose(half_turn, [-0.030, 0.0], atol=0.001)
    np.testing.assert_allclose(mug.shift(np.array([0.0]))[0], [0.0, 0.0], atol=1e-4)


def test_the_yaw_of_a_body_of_revolution_is_unobservable() -> None:
    can = yaw_observability(model_surface(read_object("can"), Pose(), 0.003))
    assert can.largest_distances.max() < 0.005


def test_sliding_finds_the_place_and_leaves_the_yaw() -> None:
    surface = model_surface(read_object("duck"), Pose(), 0.003)
    start = np.array([[0.008, -0.006, 0.0]])
    found = slide(surface, surface.points, start, 12, 0.004)[0]
    np.testing.assert_allclose(found, [0.0, 0.0, 0.0], atol=0.0005)


def test_of_a_thin_wall_the_camera_s_side_is_matched() -> None:
    surface = model_surface(read_object("cup"), Pose(), 0.003)
    eye = np.array([-1.0, 0.0, 0.5])
    outside = np.array([[-0.033, 0.0, 0.05]])
    behind = outside + np.array([0.003, 0.0, 0.0])
    pose = np.zeros((1, 3))
    assert surface_distances(surface, outside, pose, eye)[0, 0] < 0.0005
    # On the inner side of the wall that the camera sees from outside: 3 mm off, although that side is near.
    assert surface_distances(surface, behind, pose, eye)[0, 0] == pytest.approx(0.003, abs=0.0005)
