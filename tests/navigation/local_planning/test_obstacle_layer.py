from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Path2D, Pose2D
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer
from bestman_bt.navigation.localization.scan_to_map import cast_rays

ANGLES = np.linspace(-math.pi, math.pi, 360, endpoint=False)


def scan_of(segments, pose, stamp=0.0):
    ranges, _ = cast_rays(segments, pose, ANGLES)
    ranges = np.where((ranges > 0.45) & (ranges < 8.0), ranges, np.inf)
    return LaserScan(ranges, -math.pi, 2 * math.pi / 360, 0.45, 8.0, stamp)


def post(x, y, half=0.1):
    corners = np.array([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


@pytest.fixture
def layer(costmap):
    made = ObstacleLayer()
    made.use_costmap(costmap)
    return made


def test_a_costmap_has_what_was_seen_where_it_is_to_a_cell_of_the_layer(layer, costmap, kitchen):
    pose = Pose2D(0.3, 0.2, 0.0)
    layer.update(scan_of(np.vstack([kitchen.walls, post(1.3, 0.2)]), pose), pose)
    seen = layer.on(costmap)
    for before in (0.1, 0.3, 0.5):
        place = [1.2 - before, 0.2]
        assert seen.distance_at(place) == pytest.approx(before - costmap.rasterization.clearance, abs=0.025)
        assert costmap.distance_at(place) > seen.distance_at(place)
    far = np.array([-2.0, 0.5])
    assert seen.distance_at(far) == costmap.distance_at(far)


def test_with_nothing_unknown_around_it_is_the_same_costmap(layer, costmap, kitchen):
    pose = Pose2D(0.3, 0.2, 0.7)
    layer.update(scan_of(kitchen.walls, pose), pose)
    assert layer.on(costmap) is costmap


def test_a_path_leads_around_what_was_seen(layer, costmap, kitchen):
    start, goal = Pose2D(0.6, 0.0, 0.0), Pose2D(2.0, 0.6, 0.0)
    layer.update(scan_of(np.vstack([kitchen.walls, post(1.3, 0.3)]), start), start)
    straight, around = (GridAStar().plan(start, goal, c) for c in (costmap, layer.on(costmap)))
    assert isinstance(straight, Path2D)
    assert isinstance(around, Path2D)
    assert around.length > straight.length + 0.05


def test_what_is_cleared_is_marked_again_if_it_is_still_there(layer, kitchen):
    pose, surroundings = Pose2D(0.3, 0.2, 0.0), np.vstack([kitchen.walls, post(1.3, 0.2)])
    layer.update(scan_of(surroundings, pose), pose)
    before = layer.points
    layer.clear()
    assert not len(layer.points)
    layer.update(scan_of(surroundings, pose, 0.1), pose)
    assert np.array_equal(layer.points, before)


def test_only_what_is_chosen_is_cleared(layer, kitchen):
    pose = Pose2D(0.3, 0.2, 0.0)
    layer.update(scan_of(np.vstack([kitchen.walls, post(1.3, 0.2), post(0.6, -1.2)]), pose), pose)
    layer.clear(lambda points: points[:, 1] < -0.5)
    assert len(layer.points)
    assert (layer.points[:, 1] > -0.5).all()


def test_what_the_map_comes_to_know_is_no_longer_of_the_layer(costmap, kitchen):
    layer, pose = ObstacleLayer(), Pose2D(0.3, 0.2, 0.0)
    layer.update(scan_of(np.vstack([kitchen.walls, post(1.3, 0.2)]), pose), pose)
    layer.use_costmap(costmap)
    assert np.linalg.norm(layer.points - [1.3, 0.2], axis=1).max() < 0.2


def test_hits_far_away_mark_nothing(layer, kitchen):
    pose = Pose2D(-3.2, 0.0, 0.0)
    layer.update(scan_of(np.vstack([kitchen.walls, post(2.2, 0.0)]), pose), pose)
    assert not len(layer.points)


def test_a_walker_at_rest_counts_as_a_person_and_a_static_obstacle_does_not(layer, kitchen):
    pose, noise = Pose2D(0.3, 0.2, 0.0), np.random.default_rng(4)
    for number in range(60):
        now = 0.1 * number
        walked = -0.9 + 0.5 * min(now, 2.5)
        scan = scan_of(np.vstack([kitchen.walls, post(1.3, 0.9), post(1.5, walked, 0.15)]), pose, now)
        ranges = scan.ranges + 0.01 * noise.standard_normal(360)
        layer.update(LaserScan(ranges, -math.pi, 2 * math.pi / 360, 0.45, 8.0, now), pose)
    assert not layer.moving.obstacles
    assert [(walker.x, walker.y) for walker in layer.moving.walkers] == [pytest.approx((1.5, 0.35), abs=0.1)]


STEP = 2 * math.pi / 360


def beams(ranges: dict[int, float], stamp: float, count: int = 360, angle_min: float = -math.pi) -> LaserScan:
    """Beams by number, counted from straight ahead; the others hit nothing."""
    values = np.full(count, np.inf)
    for number, away in ranges.items():
        values[(number + round(-angle_min / STEP)) % 360] = away
    return LaserScan(values, angle_min, STEP, 0.45, 8.0, stamp)


@pytest.mark.parametrize(("off", "cleared"), [(0.4, True), (0.6, False), (-0.4, True), (-0.6, False)])
def test_a_mark_is_cleared_by_the_beam_that_passes_through_it_and_by_none_beside(off, cleared):
    """One free beam between two that hit; the mark lies ``off`` of an increment beside the free one."""
    layer, pose = ObstacleLayer(), Pose2D(0.4, -0.3, 1.1)
    mark = pose.apply(np.array([[2.0 * math.cos(off * STEP), 2.0 * math.sin(off * STEP)]]))
    cell = np.floor(mark / 0.025) * 0.025 + 0.0125
    turned = Pose2D(pose.x, pose.y, float(np.arctan2(*(cell[0] - pose.xy)[::-1])) - off * STEP)
    away = float(np.linalg.norm(cell[0] - pose.xy))
    exact = LaserScan(np.array([away]), off * STEP, STEP, 0.45, 8.0, 0.0)
    layer.update(exact, turned)
    assert layer.points == pytest.approx(cell)
    for number in range(1, 4):
        layer.update(beams({-1: away, 0: 5.5, 1: away}, 0.1 * number), turned)
    kept = len(layer.points) and np.linalg.norm(layer.points - cell, axis=1).min() < 1e-6
    assert bool(kept) != cleared


@pytest.mark.parametrize(("measured", "cleared"), [(1.54, False), (1.56, True), (math.inf, True), (1.0, False)])
def test_only_a_beam_that_goes_on_behind_it_clears_a_mark(measured, cleared):
    layer, pose = ObstacleLayer(), Pose2D(0.0125, 0.0125, 0.0)
    layer.update(beams({0: 1.5}, 0.0), pose)
    for number in range(1, 4):
        assert len(layer.points), "three scans must see through it"
        layer.update(beams({0: measured}, 0.1 * number), pose)
    gone = not len(layer.points) or np.linalg.norm(layer.points - [1.5125, 0.0125], axis=1).min() > 0.05
    assert gone == cleared


@pytest.mark.parametrize("off", [-0.3, 0.3])
def test_where_its_beams_meet_a_lidar_that_sees_all_round_clears_as_elsewhere(off):
    """The mark lies straight behind, ``off`` of an increment beside the first beam; all others hit something nearer."""
    layer = ObstacleLayer()
    layer.update(beams({180: 1.5}, 0.0), Pose2D(0.0125, 0.0125, 0.0))
    assert layer.points == pytest.approx(np.array([[-1.4875, 0.0125]]))
    others = {number: 1.0 for number in range(360) if number != 180}
    for number in range(1, 4):
        layer.update(beams(others, 0.1 * number), Pose2D(0.0125, 0.0125, off * STEP))
    assert np.linalg.norm(layer.points - [-1.4875, 0.0125], axis=1).min() > 0.1


def test_a_lidar_that_looks_ahead_clears_nothing_behind_it():
    layer, pose = ObstacleLayer(), Pose2D(0.0125, 0.0125, 0.0)
    layer.update(beams({180: 1.5}, 0.0), pose)
    before = layer.points
    for number in range(1, 6):
        layer.update(beams({}, 0.1 * number, count=180, angle_min=-math.pi / 2), pose)
    assert np.array_equal(layer.points, before)


def test_marks_stay_where_they_are_when_the_square_rolls_and_are_forgotten_beyond_it():
    layer, pose = ObstacleLayer(), Pose2D(0.0125, 0.0125, 0.0)
    layer.update(beams({0: 1.5, 120: 2.0}, 0.0), pose)
    before = np.sort(layer.points, axis=0)
    layer.centre_on(Pose2D(2.3, -1.7, 0.0))
    assert np.sort(layer.points, axis=0) == pytest.approx(before)
    layer.centre_on(Pose2D(9.0, 0.0, 0.0))
    assert len(layer.points) == 1
    layer.centre_on(Pose2D(60.0, 0.0, 0.0))
    layer.centre_on(pose)
    assert not len(layer.points)
