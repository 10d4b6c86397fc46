"""The axis of a joint is learned from places on the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.control.arm.joint_axis import JointAxis, JointAxisEstimator


def arc(radius: float, angle: float, noise: float = 0.0) -> np.ndarray:
    """Places on an arc about -z that starts at (0, radius, 1) towards +x."""
    angles = np.linspace(0.0, angle, 120)
    way = np.column_stack([radius * np.sin(angles), radius * np.cos(angles), np.ones(120)])
    return way + np.random.default_rng(1).normal(0.0, noise, way.shape)


def learn(way: np.ndarray, hint=None, direction=(1.0, 0.0, 0.0)) -> JointAxisEstimator:
    estimator = JointAxisEstimator(np.array(direction), way[0], hint)
    for place in way[1:]:
        estimator.add(place)
    return estimator


@pytest.mark.parametrize("radius", [0.2, 0.35, 0.6])
def test_the_axis_of_a_door_is_learned_from_the_beginning_of_its_motion(radius):
    axis = learn(arc(radius, 0.5, noise=0.0001)).axis
    assert axis.kind == "revolute"
    assert axis.radius == pytest.approx(radius, rel=0.05)
    np.testing.assert_allclose(axis.direction, [0.0, 0.0, -1.0], atol=0.05)
    np.testing.assert_allclose(axis.point[:2], [0.0, 0.0], atol=0.05 * radius)


def test_the_angle_and_the_way_are_those_of_the_arc():
    way = arc(0.4, 1.2)
    axis = learn(way).axis
    assert axis.angle(way[0], way[-1]) == pytest.approx(1.2, abs=0.01)
    assert axis.travelled(way[0], way[-1]) == pytest.approx(0.48, abs=0.005)
    np.testing.assert_allclose(axis.tangent(way[-1]), [math.cos(1.2), -math.sin(1.2), 0.0], atol=0.02)
    above = replace(axis, point=axis.point - 0.3 * axis.direction)  # any point of the axis will do
    assert above.angle(way[0], way[-1]) == pytest.approx(axis.angle(way[0], way[-1]))


def test_a_drawer_stays_a_line_although_the_hand_creeps():
    way = np.column_stack([np.linspace(0, 0.3, 150), np.zeros(150), np.linspace(0, 0.002, 150)])
    axis = learn(way + np.random.default_rng(2).normal(0.0, 0.0001, way.shape), direction=(0.9, 0.1, 0.0)).axis
    assert axis.kind == "prismatic"
    np.testing.assert_allclose(axis.direction, [1.0, 0.0, 0.0], atol=0.02)
    assert axis.travelled(way[0], way[-1]) == pytest.approx(0.3, abs=0.002)


def test_before_anything_has_moved_the_guess_holds():
    estimator = JointAxisEstimator(np.array([0.0, -1.0, 0.0]), np.zeros(3))
    estimator.add(np.array([0.0, 0.0, 0.0005]))
    np.testing.assert_array_equal(estimator.axis.tangent(np.zeros(3)), [0.0, -1.0, 0.0])


def test_where_a_drawer_is_known_no_bend_makes_it_a_door():
    assert learn(arc(0.6, 0.4), hint="prismatic").axis.kind == "prismatic"


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_an_axis_is_right_handed_about_the_way_that_was_gone_whichever_side_it_turns_to(side, tilt):
    way = arc(0.4, 0.9)
    way[:, 0] *= side
    cos, sin = math.cos(tilt), math.sin(tilt)
    way = way @ np.array([[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]]) + [2.0, -1.0, 0.5]
    axis = learn(way, direction=(side, 0.0, 0.0)).axis
    assert axis.kind == "revolute"
    assert axis.direction == pytest.approx(-side * np.array([0.0, -sin, cos]), abs=0.02)
    assert axis.angle(way[0], way[-1]) == pytest.approx(0.9, abs=0.01)
    onward = axis.tangent(way[60])
    assert float(onward @ (way[61] - way[60])) > 0.0
    assert axis.travelled(way[60], way[-1]) == pytest.approx(0.9 * 0.4 * 59 / 119, abs=0.005)
    assert axis.angle(way[-1], way[0]) == pytest.approx(-0.9, abs=0.01)


def test_a_hinge_that_is_expected_is_believed_sooner():
    way = arc(0.6, 0.14)  # a bulge of about 1.5 mm
    flat = arc(0.6, 0.115)  # and of about 1 mm
    assert [learn(flat, hint).axis.kind for hint in (None, "revolute")] == ["prismatic", "revolute"]
    assert learn(arc(0.6, 0.08), "revolute").axis.kind == "prismatic"
    assert learn(way, "prismatic").axis.kind == "prismatic"


def test_a_radius_beyond_that_of_any_hinge_is_a_line():
    assert learn(arc(1.4, 0.5)).axis.kind == "revolute"
    assert learn(arc(1.7, 0.5)).axis.kind == "prismatic"


@pytest.mark.parametrize("heading", [0.0, 1.0, math.pi / 2, math.pi, 4.0])
def test_a_line_points_the_way_that_was_gone(heading):
    onward = np.array([math.cos(heading), math.sin(heading), 0.0])
    way = np.linspace(0, 0.3, 150)[:, None] * onward + [0.5, -0.2, 1.0]
    axis = learn(way, direction=onward + np.array([0.1, 0.2, 0.0])).axis
    assert axis.direction == pytest.approx(onward, abs=1e-3)
    assert axis.travelled(way[0], way[-1]) == pytest.approx(0.3)


def test_what_is_believed_holds_until_the_way_is_long_enough_and_for_good_where_nothing_is_learned():
    way, believed = arc(0.4, 1.0), JointAxis("revolute", np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.9, 0.0)
    for learns in (True, False):
        estimator = JointAxisEstimator(np.array([1.0, 0.0, 0.0]), way[0], believed=believed, learns=learns)
        for place in way[1:]:
            estimator.add(place)
            gone = float(np.linalg.norm(place - way[0]))
            if gone < 0.12 or not learns:
                assert estimator.axis is believed
        assert (estimator.axis is believed) != learns
