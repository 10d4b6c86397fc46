from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.navigation.localization.base import OdometryScan
from bestman_bt.navigation.localization.correlative_search import CorrelativeSearch
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.navigation.localization.simulated_scans import BASE_FROM_LIDAR, ahead_only, grid_of, scan_at

PLACES = [Pose2D(-0.2, 1.8, -2.0), Pose2D(0.9, -1.7, 0.4), Pose2D(3.6, 0.6, 3.0), Pose2D(2.2, -1.8, 1.2)]


def rooms_alike() -> SemanticMap:
    """Two rooms that look the same from inside, but for a niche in the second one."""
    room = np.array([(0, 0, 4, 0), (4, 0, 4, 3), (4, 3, 0, 3), (0, 3, 0, 0)], dtype=float)
    niche = np.array([(10.6, 0.5, 10.6, 1.3), (10.0, 0.5, 10.6, 0.5), (10.0, 1.3, 10.6, 1.3)], dtype=float)
    second = np.delete(room, 1, axis=0) + np.array([6.0, 0.0, 6.0, 0.0])
    second = np.vstack([second, (10.0, 0.0, 10.0, 0.5), (10.0, 1.3, 10.0, 3.0)])
    return SemanticMap(np.vstack([room, second, niche]), {})


def is_at(pose: Pose2D, truth: Pose2D, position: float = 0.02, heading: float = math.radians(0.5)) -> bool:
    return pose.distance_to(truth) < position and abs(wrap_angle(pose.theta - truth.theta)) < heading


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("truth", PLACES)
def test_one_scan_reports_where_on_the_map_the_base_is(kitchen, truth):
    scan = scan_at(truth, kitchen.lidar_segments(), np.random.default_rng(1), noise=0.02)
    best, *others = CorrelativeSearch().locate(kitchen, [OdometryScan(Pose2D(), scan)], BASE_FROM_LIDAR)
    assert is_at(best.pose, truth)
    assert best.probability > 0.99
    assert best.explained > 0.9
    assert best.position_std < 0.02
    assert all(other.probability <= best.probability for other in others)


def test_a_grid_is_searched_as_a_map_of_walls_is(kitchen):
    truth = PLACES[1]
    scan = scan_at(truth, kitchen.lidar_segments(), np.random.default_rng(2))
    best, *_ = CorrelativeSearch().locate(grid_of(kitchen), [OdometryScan(Pose2D(), scan)], BASE_FROM_LIDAR)
    assert is_at(best.pose, truth, 0.04, math.radians(1.0))


def test_places_that_look_alike_share_the_probability_and_are_half_a_turn_apart():
    room = SemanticMap(rooms_alike().walls[:4], {})
    truth = Pose2D(1.2, 0.8, 0.3)
    scan = scan_at(truth, room.walls, np.random.default_rng(3))
    places = CorrelativeSearch().locate(room, [OdometryScan(Pose2D(), scan)], BASE_FROM_LIDAR)
    mirrored = Pose2D(4.0 - truth.x, 3.0 - truth.y, truth.theta + math.pi)
    assert {True} == {any(is_at(place.pose, pose) for place in places[:2]) for pose in (truth, mirrored)}
    assert places[0].probability < 0.9
    assert sum(place.probability for place in places) <= 1.0 + 1e-9


@pytest.mark.slow
def test_what_a_turn_brings_into_view_decides_between_two_rooms():
    rooms = rooms_alike()
    rng = np.random.default_rng(4)
    truth = Pose2D(7.5, 1.6, math.pi)  # the niche is behind it
    half = math.radians(60.0)
    first = OdometryScan(Pose2D(), ahead_only(scan_at(truth, rooms.walls, rng), half))
    turned = Pose2D(0.0, 0.0, math.pi)
    second = OdometryScan(turned, ahead_only(scan_at(truth @ turned, rooms.walls, rng), half))
    search = CorrelativeSearch()
    before = search.locate(rooms, [first], BASE_FROM_LIDAR)
    after = search.locate(rooms, [first, second], BASE_FROM_LIDAR)
    assert before[0].probability < 0.9
    assert after[0].probability > 0.95
    assert is_at(after[0].pose, truth @ turned, 0.03, math.radians(1.0))


def test_a_building_that_is_not_on_the_map_is_not_found(kitchen):
    around = np.linspace(0.0, 2.0 * math.pi, 40)
    tower = 1.7 * np.column_stack([np.cos(around), np.sin(around)])
    scan = scan_at(Pose2D(), np.hstack([tower[:-1], tower[1:]]), np.random.default_rng(5))
    places = CorrelativeSearch().locate(kitchen, [OdometryScan(Pose2D(), scan)], BASE_FROM_LIDAR)
    assert places == ()


def test_a_blind_scan_finds_nothing_and_no_scan_is_an_error(kitchen):
    blind = LaserScan(np.full(360, np.inf), -math.pi, math.pi / 180, 0.1, 8.0, 0.0)
    search = CorrelativeSearch()
    assert search.locate(kitchen, [OdometryScan(Pose2D(), blind)], BASE_FROM_LIDAR) == ()
    with pytest.raises(ValueError, match="at least one scan"):
        search.locate(kitchen, [], BASE_FROM_LIDAR)


@pytest.mark.slow
def test_equal_scans_are_found_at_the_same_place_to_the_last_bit(kitchen):
    scan = scan_at(PLACES[2], kitchen.lidar_segments(), np.random.default_rng(6))
    first, second = (
        CorrelativeSearch().locate(kitchen, [OdometryScan(Pose2D(), scan)], BASE_FROM_LIDAR) for _ in range(2)
    )
    assert first == second
