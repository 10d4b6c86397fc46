from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Path2D, Pose2D
from bestman_bt.navigation.global_planning import GridAStar
from bestman_bt.navigation.local_planning import ObstacleLayer
from bestman_bt.navigation.localization.ray_casting import cast_rays

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
        assert seen.distance_at(place) == pytest.approx(before - costmap.parameters.clearance, abs=0.025)
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


def test_who_has_walked_and_stands_now_counts_as_a_person_and_what_always_stood_does_not(layer, kitchen):
    pose, noise = Pose2D(0.3, 0.2, 0.0), np.random.default_rng(4)
    for number in range(60):
        now = 0.1 * number
        walked = -0.9 + 0.5 * min(now, 2.5)
        scan = scan_of(np.vstack([kitchen.walls, post(1.3, 0.9), post(1.5, walked, 0.15)]), pose, now)
        ranges = scan.ranges + 0.01 * noise.standard_normal(360)
        layer.update(LaserScan(ranges, -math.pi, 2 * math.pi / 360, 0.45, 8.0, now), pose)
    assert not layer.moving
    assert [(walker.x, walker.y) for walker in layer.walkers] == [pytest.approx((1.5, 0.35), abs=0.1)]
