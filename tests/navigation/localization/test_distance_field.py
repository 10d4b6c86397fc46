from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.navigation.localization.correlative_search import DistanceField
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.navigation.localization.simulated_scans import grid_of


def distance_at(field: DistanceField, points) -> np.ndarray:
    x, y = np.array(points, dtype=float).T
    return field.distance.ravel()[field.index(x, y)]


def test_the_field_holds_the_distance_to_the_nearest_line_up_to_its_reach(kitchen):
    field = DistanceField.of_map(kitchen, 0.05, reach=1.0)
    points = [(0.025, 2.025), (0.475, 0.025), (-0.475, -2.125), (50.0, 50.0)]
    np.testing.assert_allclose(distance_at(field, points), [0.475, 1.0, 0.275, 1.0], atol=0.005)


def test_the_floor_is_indoors_and_clear_of_walls_and_furniture(kitchen):
    field = DistanceField.of_map(kitchen, 0.05, clearance=0.2)
    floor = {tuple(point) for point in np.round(field.floor_points(), 3)}
    assert (-0.025, 0.025) in floor
    assert (5.025, 0.025) not in floor  # outside
    assert (1.575, -1.025) not in floor  # within the wall
    assert (3.375, -0.925) not in floor  # under the table
    x, y = field.floor_points().T
    assert distance_at(field, np.column_stack([x, y])).min() > 0.2
    area = len(x) * 0.05**2
    assert 15.0 < area < 5.2 * 4.9


def test_without_walls_all_around_the_floor_is_everything_that_is_free():
    one_wall = SemanticMap(np.array([[0.0, 0.0, 3.0, 0.0]]), {})
    field = DistanceField.of_map(one_wall, 0.1, reach=1.0, clearance=0.2)
    assert field.floor.mean() > 0.5


def test_what_is_unknown_in_a_grid_is_no_floor(kitchen):
    field = DistanceField.of_map(grid_of(kitchen), 0.05, clearance=0.2)
    exact = DistanceField.of_map(kitchen, 0.05, clearance=0.2)
    assert len(field.floor_points()) == pytest.approx(len(exact.floor_points()), rel=0.05)


def test_drawn_poses_lie_on_the_floor_and_look_everywhere(kitchen):
    field = DistanceField.of_map(kitchen, 0.05, clearance=0.2)
    poses = field.draw(2000, np.random.default_rng(1))
    assert distance_at(field, poses[:, :2]).min() > 0.2
    assert poses[:, 2].min() < -0.9 * math.pi
    assert poses[:, 2].max() > 0.9 * math.pi
    share_left_of_the_wall = np.mean(poses[:, 0] < 1.5)
    points = field.floor_points()
    assert share_left_of_the_wall == pytest.approx(np.mean(points[:, 0] < 1.5), abs=0.04)
