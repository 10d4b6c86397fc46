from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.rendered_table import TrueObject, mast_camera, solid
from bestman_bt.messages import Box
from bestman_bt.messages.pose import wrap_angle
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart

from .seen_objects import cluster_of, photographed, shipped, standing

ESTIMATOR = MultiStart()
AWAY = 0.0
"""The yaw at which the handle points away from the camera on the mast."""


@cache
def seen(name: str, yaw: float, seed: int = 0) -> tuple[TrueObject, PoseHypothesis]:
    item = standing(shipped(name), -0.1, 0.0, yaw)
    view = photographed([item], seed=seed)
    return item, ESTIMATOR.estimate(cluster_of(view, item), [item.model], view)[0]


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("yaw", [1.6, -1.6, 2.6])
def test_the_yaw_of_a_mug_is_known_where_its_handle_is_seen(yaw: float) -> None:
    item, found = seen("mug", yaw)
    assert found.yaw_set.contains(item.pose.yaw)
    assert math.degrees(found.yaw_set.width) <= 20.0
    assert not found.ambiguous_yaw
    assert abs(wrap_angle(found.pose.yaw - item.pose.yaw)) < math.radians(8.0)
    assert np.linalg.norm(found.pose.position - item.pose.position) < 0.004


@pytest.mark.slow
def test_a_mug_reports_what_it_hides_where_its_handle_is_behind_it() -> None:
    item, found = seen("mug", AWAY)
    assert found.ambiguous_yaw
    assert found.yaw_set.contains(item.pose.yaw)
    assert found.yaw_set.contains(item.pose.yaw + 0.2)
    assert not found.yaw_set.contains(item.pose.yaw + math.pi / 2)
    assert not found.yaw_set.contains(item.pose.yaw + math.pi)
    assert found.confidence > 0.9


def test_yaws_that_another_object_hides_stay_open() -> None:
    mug = standing(shipped("mug"), 0.0, 0.0, math.pi)
    screen = standing(solid("screen", Box((0.02, 0.20, 0.10)), (0.2, 0.5, 0.3), 2), -0.14, 0.0, 0.0)
    view = photographed([mug, screen], mast_camera(0.6, 0.0))
    found = ESTIMATOR.estimate(cluster_of(view, mug), [mug.model], view)[0]
    assert found.yaw_set.contains(mug.pose.yaw)


@pytest.mark.slow
@pytest.mark.parametrize("yaw", [0.0, 1.5, 3.0, -1.5])
def test_the_yaw_of_a_duck_is_known_from_one_view(yaw: float) -> None:
    item, found = seen("duck", yaw)
    assert found.yaw_set.contains(item.pose.yaw)
    assert math.degrees(found.yaw_set.width) <= 30.0
    assert abs(wrap_angle(found.pose.yaw - item.pose.yaw)) < math.radians(5.0)


@pytest.mark.slow
def test_a_bowl_has_no_yaw() -> None:
    _, found = seen("bowl", 0.7)
    assert found.yaw_set.arcs == ()
    assert not found.ambiguous_yaw
    assert found.yaw_std == pytest.approx(math.pi)


@pytest.mark.slow
def test_equal_views_leave_equal_yaws_open() -> None:
    item, first = seen("mug", AWAY)
    view = photographed([item])
    second = MultiStart().estimate(cluster_of(view, item), [item.model], view)[0]
    assert second.yaw_set == first.yaw_set
    np.testing.assert_array_equal(second.covariance, first.covariance)


@pytest.mark.slow
def test_confidence_falls_where_the_border_of_the_image_cuts_an_object() -> None:
    item = standing(shipped("bottle"), -0.1, 0.0, 0.0)
    whole = photographed([item])
    cut = photographed([item], mast_camera(0.8, math.radians(60.0)))
    cluster = cluster_of(cut, item)
    assert cluster.at_border
    of_whole = ESTIMATOR.estimate(cluster_of(whole, item), [item.model], whole)[0]
    of_cut = ESTIMATOR.estimate(cluster, [item.model], cut)[0]
    assert of_cut.confidence < of_whole.confidence - 0.01
    assert np.linalg.norm(of_cut.pose.position - item.pose.position) < 0.005


@pytest.mark.slow
def test_a_model_that_explains_nothing_gets_no_confidence_and_does_not_fail() -> None:
    item = standing(shipped("can"), -0.1, 0.0, 0.0)
    view = photographed([item])
    cluster = cluster_of(view, item)
    far = replace(cluster, points=cluster.points + np.array([0.25, 0.2, 0.0]))
    models = [shipped(name) for name in ("mug", "duck", "bowl", "sugar_box")]
    found = MultiStart(color_limit=9.0, size_tolerance=1.0).estimate(far, models, view)
    assert {one.model.name for one in found} == {"mug", "duck", "bowl", "sugar_box"}
    assert all(one.confidence < 0.01 for one in found)
