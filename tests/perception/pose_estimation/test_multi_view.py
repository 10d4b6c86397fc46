from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from benchmarks.rendered_table import TrueObject
from bestman_bt.messages import Pose
from bestman_bt.messages.pose import wrap_angle
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.pose_estimation.multi_view import MultiView, ViewObservation
from bestman_bt.perception.view import View
from bestman_bt.perception.view_planning import looking_at

from .seen_objects import MAST, cluster_of, photographed, shipped, standing

FUSION = MultiView()


@cache
def looks(name: str, yaw: float, lifted: float = 0.0) -> tuple[TrueObject, ViewObservation, ViewObservation]:
    """From the mast, and from 0.4 m to the side; that camera is believed ``lifted`` metres higher than it is."""
    item = standing(shipped(name), -0.1, 0.0, yaw)
    beside = looking_at(item.pose.position, math.pi / 2, math.radians(45.0), 0.4)
    views = [photographed([item], MAST), photographed([item], beside, seed=1)]
    raised = Pose(beside.position + np.array([0.0, 0.0, lifted]), beside.quaternion)
    views[1] = View(views[1].image, raised)
    first, second = (ViewObservation(cluster_of(view, item), view) for view in views)
    return item, first, second


@pytest.mark.slow
def test_a_second_view_reports_the_yaw_that_the_first_left_open() -> None:
    item, first, second = looks("mug", 0.0)
    alone = MultiStart().estimate(first.cluster, [item.model], first.view)[0]
    both = FUSION.estimate([first, second], [item.model])[0]
    assert alone.ambiguous_yaw
    assert not both.ambiguous_yaw
    assert both.yaw_set.contains(item.pose.yaw)
    assert math.degrees(both.yaw_set.width) <= 20.0
    assert abs(wrap_angle(both.pose.yaw - item.pose.yaw)) < math.radians(5.0)
    assert np.linalg.norm(both.pose.position - item.pose.position) < 0.003
    assert both.confidence > 0.9


@pytest.mark.slow
def test_the_order_of_the_views_does_not_matter_much() -> None:
    item, first, second = looks("mug", 0.0)
    one = FUSION.estimate([first, second], [item.model])[0]
    other = FUSION.estimate([second, first], [item.model])[0]
    np.testing.assert_allclose(one.pose.position, other.pose.position, atol=0.001)
    assert abs(wrap_angle(one.pose.yaw - other.pose.yaw)) < math.radians(2.0)


@pytest.mark.slow
def test_equal_views_give_equal_results() -> None:
    item, first, second = looks("mug", 0.0)
    one = FUSION.estimate([first, second], [item.model])[0]
    other = MultiView().estimate([first, second], [item.model])[0]
    np.testing.assert_array_equal(one.pose.matrix, other.pose.matrix)
    assert one.yaw_set == other.yaw_set
    assert one.confidence == other.confidence


@pytest.mark.slow
def test_a_camera_that_is_believed_too_high_does_not_spoil_the_evidence() -> None:
    item, first, second = looks("box", 0.4, 0.006)
    both = FUSION.estimate([first, second], [item.model])[0]
    assert both.confidence > 0.8
    assert np.linalg.norm((both.pose.position - item.pose.position)[:2]) < 0.004


@pytest.mark.slow
def test_several_views_name_the_object_and_narrow_its_place() -> None:
    item, first, second = looks("box", 0.4)
    models = [shipped(name) for name in ("box", "can", "bowl", "duck", "sugar_box")]
    both = FUSION.estimate([first, second], models)
    assert both[0].model is item.model
    # As good as one view without camera error, at most as bad as the error of the camera poses.
    assert both[0].position_std < FUSION.camera_position_std
    assert len(both[0].yaw_set.arcs) == 1


@pytest.mark.slow
def test_one_observation_is_the_single_view_s_estimate() -> None:
    item, first, _ = looks("can", 0.0)
    alone = FUSION.estimate([first], [item.model])[0]
    single = MultiStart().estimate(first.cluster, [item.model], first.view)[0]
    np.testing.assert_array_equal(alone.pose.matrix, single.pose.matrix)


def test_no_observation_is_refused() -> None:
    with pytest.raises(PerceptionError, match="at least one observation"):
        FUSION.estimate([], [shipped("can")])


def test_a_model_of_another_size_is_not_proposed() -> None:
    _, first, second = looks("can", 0.0)
    assert FUSION.estimate([first, second], [shipped("tin")]) == ()
