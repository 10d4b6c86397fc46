from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.navigation.localization.scan_to_map import ScanToMap
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap
from tests.navigation.localization.simulated_scans import BASE_FROM_LIDAR, BEAMS, grid_of, scan_at
from tests.navigation.localization.tracking import Tracking


def actual(semantic_map: SemanticMap, offset: Pose2D) -> SemanticMap:
    """The map as the world really is: each piece of furniture moved by ``offset``."""
    moved = {
        name: MapFurniture(
            name,
            Pose2D(f.pose.x + offset.x, f.pose.y + offset.y, f.pose.theta + offset.theta),
            f.footprint,
            f.height,
            f.surfaces,
            f.solid_at_lidar,
        )
        for name, f in semantic_map.furniture.items()
    }
    return SemanticMap(semantic_map.walls, moved)


def errors(pose: Pose2D, truth: Pose2D) -> tuple[float, float]:
    return pose.distance_to(truth), abs(wrap_angle(pose.theta - truth.theta))


def localizer_at(semantic_map, pose, position_std=0.02, heading_std=0.012):
    return Tracking(ScanToMap(semantic_map), pose, Pose2D(), position_std, heading_std)


@pytest.mark.parametrize("truth", [Pose2D(0.0, 0.0, 0.3), Pose2D(2.6, -0.9, 0.0), Pose2D(2.9, 1.5, 1.57)])
def test_one_scan_corrects_a_start_pose_that_is_3_cm_and_1_degree_off(kitchen, truth):
    rng = np.random.default_rng(1)
    localizer = localizer_at(kitchen, Pose2D(truth.x + 0.03, truth.y - 0.03, truth.theta + 0.02))
    estimate = localizer.correct(scan_at(truth, kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
    position, heading = errors(estimate.pose, truth)
    assert estimate.match.accepted
    assert position < 0.005
    assert heading < math.radians(0.2)


def test_furniture_that_is_3_cm_off_moves_the_estimate_by_no_more_than_a_few_millimetres(kitchen):
    rng = np.random.default_rng(2)
    truth = Pose2D(2.9, 1.5, 1.57)
    world = actual(kitchen, Pose2D(0.03, -0.03, math.radians(2)))
    localizer = localizer_at(kitchen, truth)
    for _ in range(10):
        estimate = localizer.correct(scan_at(truth, world.lidar_segments(), rng), BASE_FROM_LIDAR)
    position, heading = errors(estimate.pose, truth)
    assert position < 0.005
    assert heading < math.radians(0.2)


def test_legs_and_people_that_the_map_does_not_know_do_not_mislead_it(kitchen):
    rng = np.random.default_rng(3)
    truth = Pose2D(2.3, -0.3, -0.5)
    around = np.linspace(0, 2 * math.pi, 9)
    clutter = [kitchen.lidar_segments()]
    for x, y, radius in [(3.1, -0.4, 0.03), (3.1, -1.4, 0.03), (2.4, 0.8, 0.25), (1.9, -0.9, 0.15)]:
        ring = np.column_stack([x + radius * np.cos(around), y + radius * np.sin(around)])
        clutter.append(np.hstack([ring[:-1], ring[1:]]))
    localizer = localizer_at(kitchen, Pose2D(truth.x - 0.03, truth.y + 0.02, truth.theta - 0.02))
    for _ in range(5):
        estimate = localizer.correct(scan_at(truth, np.vstack(clutter), rng), BASE_FROM_LIDAR)
    position, heading = errors(estimate.pose, truth)
    assert estimate.match.inlier_ratio < 0.95
    assert position < 0.005
    assert heading < math.radians(0.2)


def test_driving_with_wheels_that_are_1_percent_off_keeps_the_estimate_within_a_centimetre(kitchen):
    rng = np.random.default_rng(4)
    truth, odometry = Pose2D(0.0, 0.4, 0.0), Pose2D()
    localizer = localizer_at(kitchen, Pose2D(0.02, 0.42, 0.015))
    world = actual(kitchen, Pose2D(-0.02, 0.02, math.radians(-2))).lidar_segments()
    worst = 0.0
    for tick in range(400):
        truth = truth @ Pose2D(0.006, 0.0, -0.002 if tick > 200 else 0.0)
        odometry = odometry @ Pose2D(0.006 * 1.01, 0.0, (-0.002 if tick > 200 else 0.0) * 1.02 + 0.006 * 0.01)
        estimate = localizer.predict(odometry)
        if tick % 4 == 0:
            estimate = localizer.correct(scan_at(truth, world, rng), BASE_FROM_LIDAR)
        if tick > 8:
            worst = max(worst, estimate.pose.distance_to(truth))
    drift = (Pose2D(0.02, 0.42, 0.015) @ odometry).distance_to(truth)
    assert drift > 0.04
    assert worst < 0.01
    assert estimate.position_std < 0.01


def test_the_standard_deviation_covers_the_error(kitchen):
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(60):
        truth = Pose2D(*rng.uniform([-0.5, -1.5, -3], [1.0, 1.5, 3]))
        localizer = localizer_at(
            kitchen, Pose2D(truth.x + rng.normal(0, 0.02), truth.y + rng.normal(0, 0.02), truth.theta)
        )
        estimate = localizer.correct(scan_at(truth, kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
        ratios.append(estimate.pose.distance_to(truth) / estimate.position_std)
    assert 0.3 < np.median(ratios) < 1.8


def test_odometry_alone_makes_the_estimate_less_certain(kitchen):
    localizer = localizer_at(kitchen, Pose2D(), 0.001, 0.001)
    first = localizer.predict(Pose2D(0.5, 0.0, 0.0))
    second = localizer.predict(Pose2D(2.0, 0.0, 1.0))
    assert 0.001 < first.position_std < second.position_std
    assert 0.001 < first.heading_std < second.heading_std


def boards_around(pose, places):
    """Upright boards of 1.6 m: each so many radians to the left of ahead and 75 cm away, across the way there."""
    boards = []
    for angle in places:
        middle = pose @ Pose2D(0.75 * math.cos(angle), 0.75 * math.sin(angle), angle + math.pi / 2)
        boards.append(middle.apply(np.array([[-0.8, 0.0], [0.8, 0.0]])).ravel())
    return np.array(boards)


def test_where_most_beams_end_before_the_map_the_others_report_the_pose(kitchen):
    rng = np.random.default_rng(11)
    for truth in (Pose2D(0.0, 0.0, 0.3), Pose2D(2.3, -0.3, -0.5), Pose2D(0.3, 0.4, 2.0)):
        hidden = np.vstack([kitchen.lidar_segments(), boards_around(truth, (-0.1, 2.0, -2.2))])
        localizer = localizer_at(kitchen, Pose2D(truth.x + 0.01, truth.y - 0.01, truth.theta + 0.005))
        for _ in range(10):
            estimate = localizer.correct(scan_at(truth, hidden, rng), BASE_FROM_LIDAR)
        position, heading = errors(estimate.pose, truth)
        assert estimate.match.accepted, estimate.match
        assert estimate.match.inlier_ratio < 0.35
        assert position < 0.01
        assert heading < math.radians(0.3)


def test_a_wrong_pose_is_not_believed_because_most_beams_end_before_the_map(kitchen):
    rng = np.random.default_rng(12)
    accepted = []
    for _ in range(40):
        truth = Pose2D(*rng.uniform([-0.6, -1.9, -3.1], [1.1, 2.1, 3.1]))
        away = Pose2D(float(rng.uniform(0.4, 0.8)), 0.0, float(rng.uniform(-0.5, 0.5)))
        hidden = np.vstack([kitchen.lidar_segments(), boards_around(truth, (-0.1, 2.0, -2.2))])
        localizer = localizer_at(kitchen, truth @ Pose2D(0.0, 0.0, float(rng.uniform(-3.1, 3.1))) @ away)
        estimate = localizer.correct(scan_at(truth, hidden, rng), BASE_FROM_LIDAR)
        accepted.append(estimate.match.accepted)
    assert sum(accepted) == 0


def test_a_scan_from_elsewhere_is_refused_and_the_estimate_stays(kitchen):
    rng = np.random.default_rng(6)
    localizer = localizer_at(kitchen, Pose2D(0.0, 0.0, 0.0))
    elsewhere = scan_at(Pose2D(2.6, -1.4, 2.0), kitchen.lidar_segments(), rng)
    estimate = localizer.correct(elsewhere, BASE_FROM_LIDAR)
    assert not estimate.match.accepted
    assert estimate.match.reason
    assert estimate.pose == Pose2D(0.0, 0.0, 0.0)


@pytest.mark.slow
def test_a_base_that_was_carried_off_is_not_believed_to_be_somewhere_else(kitchen):
    rng = np.random.default_rng(8)
    refused = 0
    for _ in range(25):
        believed = Pose2D(*rng.uniform([-0.6, -1.9, -3.1], [1.1, 2.1, 3.1]))  # across the wall
        truth = Pose2D(*rng.uniform([1.9, -1.9, -3.1], [3.9, 1.4, 3.1]))
        localizer = localizer_at(kitchen, believed, 0.002, 0.002)
        for _ in range(20):
            estimate = localizer.correct(scan_at(truth, kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
            refused += not estimate.match.accepted
    assert refused == 25 * 20


def test_a_slip_of_the_wheels_is_made_good_within_a_second(kitchen):
    rng = np.random.default_rng(7)
    truth = Pose2D(0.0, 0.0, 0.0)
    localizer = localizer_at(kitchen, truth, 0.001, 0.0005)
    slipped = Pose2D(0.04, 0.02, math.radians(5))
    first = localizer.correct(scan_at(slipped, kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
    assert not first.match.accepted
    assert first.position_std > 0.001
    for _ in range(9):
        estimate = localizer.correct(scan_at(slipped, kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
    position, heading = errors(estimate.pose, slipped)
    assert position < 0.005
    assert heading < math.radians(0.2)


def test_a_blind_lidar_is_refused(kitchen):
    blind = LaserScan(np.full(BEAMS, np.inf), -math.pi, 2 * math.pi / BEAMS, 0.1, 8.0, 0.0)
    estimate = localizer_at(kitchen, Pose2D()).correct(blind, BASE_FROM_LIDAR)
    assert "0 beams" in estimate.match.reason


def test_a_pose_that_nobody_knows_is_not_made_up_from_a_place_that_happens_to_fit(kitchen):
    rng = np.random.default_rng(9)
    localizer = localizer_at(kitchen, Pose2D(0.0, 0.0, 0.0), 1.0, 3.14)
    estimate = localizer.correct(scan_at(Pose2D(0.1, 0.0, 0.0), kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
    assert not estimate.match.accepted
    assert "cannot be tracked" in estimate.match.reason


def test_a_grid_serves_as_well_as_a_map_of_walls_within_half_a_cell(kitchen):
    rng = np.random.default_rng(10)
    grid = grid_of(kitchen)
    worst = 0.0
    for truth in (Pose2D(0.0, 0.0, 0.3), Pose2D(2.6, 0.4, -1.0), Pose2D(2.9, 1.2, 1.57)):
        localizer = localizer_at(grid, Pose2D(truth.x + 0.05, truth.y - 0.04, truth.theta + 0.03), 0.05, 0.03)
        for _ in range(10):
            estimate = localizer.correct(scan_at(truth, kitchen.lidar_segments(), rng), BASE_FROM_LIDAR)
        position, heading = errors(estimate.pose, truth)
        worst = max(worst, position)
        assert estimate.match.accepted
        assert heading < math.radians(0.5)
    assert worst < grid.resolution / 2


def test_the_back_of_a_shelf_is_not_taken_for_the_wall_behind_it():
    walls = np.array([[-9.0, -1.5, 2.0, -1.5], [2.0, -1.5, 2.0, 1.5], [2.0, 1.5, -9.0, 1.5]])
    shelf = MapFurniture("shelf", Pose2D(1.78, 0.0, 0.0), (0.35, 2.6), 1.2, (), solid_at_lidar=False)
    back = np.array([[1.91, -1.3, 1.91, 1.3]])
    truth, rng = Pose2D(0.5, 0.0, 0.0), np.random.default_rng(3)
    localizer = localizer_at(SemanticMap(walls, {"shelf": shelf}), truth)
    for _ in range(30):
        estimate = localizer.correct(scan_at(truth, np.concatenate([walls, back]), rng), BASE_FROM_LIDAR)
    assert errors(estimate.pose, truth)[0] < 0.01


def turned_by_dragged_wheels(semantic_map, dragged):
    """How far the estimate is off at worst, metres, in a turn on the spot that carries the base off its place.

    Ten scans a second. Its odometry counts a pure turn, a quarter too short: figures of a loaded Husky at 0.8 rad/s.
    """
    rng = np.random.default_rng(4)
    localizer = localizer_at(semantic_map, Pose2D(0.0, 0.0, 0.0), 0.005, 0.003)
    if dragged:
        localizer.localizer = localizer.localizer.for_dragged_wheels()
    truth, odometry, worst = Pose2D(), Pose2D(), 0.0
    for _ in range(30):
        truth = truth @ Pose2D(-0.006, -0.013, 0.1)
        odometry = odometry @ Pose2D(0.0, 0.0, 0.08)
        localizer.predict(odometry)
        estimate = localizer.correct(scan_at(truth, semantic_map.lidar_segments(), rng), BASE_FROM_LIDAR)
        worst = max(worst, errors(estimate.pose, truth)[0])
    return worst


def test_a_base_that_drags_its_wheels_is_tracked_through_turns(kitchen):
    assert turned_by_dragged_wheels(kitchen, dragged=True) < 0.01
    assert turned_by_dragged_wheels(kitchen, dragged=False) > 0.05
