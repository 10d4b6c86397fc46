from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.rendered_table import solid, tumbler
from bestman_bt.messages import Box, ObjectGrasp, ObjectModel, PlacedShape, Pose, Sphere
from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandSize
from bestman_bt.perception.grasp_pose.model_based import AntipodalModel, solid_surface
from tests.robot_models import gripper_model

GRIPPER = gripper_model(finger_depth=0.039, pad_size=(0.02, 0.02))
BAR = solid("bar", Box((0.12, 0.03, 0.04)), (1, 1, 1), 2)


def part(size: tuple[float, float, float], *xyz: float) -> PlacedShape:
    return PlacedShape(Box(size), Pose(np.array(xyz)))


HANDLE = (part((0.010, 0.012, 0.06), 0.075, 0, 0), part((0.035, 0.012, 0.01), 0.06, 0, 0.03))
MUG = ObjectModel("mug", (1, 1, 1), 0.1, 0.8, (PlacedShape(tumbler(0.045, 0.09), Pose()), *HANDLE))


def grasps(model: ObjectModel, count: int = 64) -> tuple[ObjectGrasp, ...]:
    return AntipodalModel().grasps(model, GRIPPER, np.random.default_rng(0), count)


@pytest.fixture(scope="module")
def of_bar() -> tuple[ObjectGrasp, ...]:
    return grasps(BAR)


@pytest.fixture(scope="module")
def of_mug() -> tuple[ObjectGrasp, ...]:
    return grasps(MUG)


def test_a_bar_is_closed_on_across_its_two_smaller_sides(of_bar: tuple[ObjectGrasp, ...]) -> None:
    assert {round(grasp.width, 4) for grasp in of_bar} == {0.03, 0.04}
    for grasp in of_bar:
        axis = 1 if grasp.width < 0.035 else 2
        assert abs(grasp.object_from_tool.rotation[axis, 1]) == pytest.approx(1.0)


def test_the_best_grasps_of_a_bar_are_at_its_middle(of_bar: tuple[ObjectGrasp, ...]) -> None:
    assert all(abs(grasp.object_from_tool.position[0]) < 0.012 for grasp in of_bar[:8])
    qualities = [grasp.quality for grasp in of_bar]
    assert qualities == sorted(qualities, reverse=True)
    assert 0.0 < qualities[-1] < qualities[0] <= 1.0


def test_hands_come_from_all_around_the_closing_axis(of_bar: tuple[ObjectGrasp, ...]) -> None:
    approaches = np.array([grasp.object_from_tool.rotation[:, 2] for grasp in of_bar])
    for direction in (np.array([0.0, 0, 1]), np.array([0.0, 0, -1]), np.array([0.0, 1, 0]), np.array([0.0, -1, 0])):
        assert (approaches @ direction).max() > 0.99


def test_no_two_grasps_are_alike(of_bar: tuple[ObjectGrasp, ...]) -> None:
    for i, one in enumerate(of_bar):
        for other in of_bar[:i]:
            apart = float(np.linalg.norm(one.object_from_tool.position - other.object_from_tool.position))
            turn = np.trace(one.object_from_tool.rotation.T @ other.object_from_tool.rotation)
            assert apart > 0.011 or math.acos(np.clip((turn - 1) / 2, -1, 1)) > math.radians(24)


@pytest.mark.slow
def test_a_mug_is_taken_by_its_rim_and_by_its_handle(of_mug: tuple[ObjectGrasp, ...]) -> None:
    walls = [grasp for grasp in of_mug if grasp.width < 0.006]
    handles = [grasp for grasp in of_mug if 0.009 < grasp.width < 0.014 and grasp.object_from_tool.position[0] > 0.05]
    assert walls
    assert handles
    for grasp in walls:
        tool = grasp.object_from_tool
        assert 0.03 < math.hypot(*tool.position[:2]) < 0.055, "the tool is at the wall"
        if tool.rotation[2, 2] < -0.99:
            assert 0.045 - tool.position[2] < 0.031, "the palm stays above the rim"


@pytest.mark.slow
def test_the_open_hand_stays_clear_of_the_model(of_mug: tuple[ObjectGrasp, ...]) -> None:
    # Sampled anew and finer than the search does.
    points = solid_surface(MUG, 0.003).points
    shape = HandShape(GRIPPER, HandSize())
    for grasp in of_mug:
        inside = grasp.object_from_tool.inverse().apply(points)
        opening = min(0.08, grasp.width + 0.02)
        centres, halves = shape.boxes(np.array([opening]))
        for centre, half in zip(centres[0], halves[0], strict=True):
            assert not np.any(np.all(np.abs(inside - centre) < half - 1e-3, axis=1))


@pytest.mark.slow
def test_what_is_too_large_has_no_grasp() -> None:
    assert grasps(solid("boulder", Sphere(0.06), (1, 1, 1), 0)) == ()


@pytest.mark.slow
def test_no_more_grasps_than_asked_for() -> None:
    assert len(grasps(BAR, 5)) == 5


@pytest.mark.slow
def test_equal_generators_give_equal_grasps(of_bar: tuple[ObjectGrasp, ...]) -> None:
    for one, other in zip(of_bar, grasps(BAR), strict=True):
        np.testing.assert_array_equal(one.object_from_tool.matrix, other.object_from_tool.matrix)
        assert one.quality == other.quality
