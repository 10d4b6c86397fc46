"""Walkers are tracked by their hits: told from what stands, remembered while hidden, forgotten when gone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacles

LIDAR = np.array([0.3, -0.2])
NOTHING = np.zeros((0, 2))


def hits_on(x: float, y: float, radius: float = 0.2, count: int = 9) -> np.ndarray:
    """The near side of a disc as a lidar sees it."""
    bearing = math.atan2(LIDAR[1] - y, LIDAR[0] - x)
    turn = bearing + np.linspace(-1.4, 1.4, count)
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


def walk(tracks: MovingObstacles, velocity=(0.0, 0.6), start=(2.0, -1.0), seconds=2.0, others=NOTHING, begin=0.0):
    """Ten scans a second; the last time, and the hits that stood in the last scan."""
    for k in range(round(seconds * 10) + 1):
        now = begin + 0.1 * k
        place = np.array(start) + np.array(velocity) * 0.1 * k
        standing = tracks.update(np.vstack([hits_on(*place), others]), LIDAR, 0.45, now)
    return now, standing


@pytest.mark.parametrize("velocity", [(0.0, 0.6), (-0.5, 0.3), (0.3, -0.2)])
def test_a_walker_is_reported_with_place_velocity_and_size_and_its_hits_no_longer_stand(velocity):
    tracks, post = MovingObstacles(), hits_on(1.0, 2.0, 0.15)
    _, standing = walk(tracks, velocity, others=post)
    (walker,) = tracks.obstacles
    assert tracks.walkers == [walker]
    assert (walker.vx, walker.vy) == pytest.approx(velocity, abs=0.05)
    end = np.array([2.0, -1.0]) + 2.0 * np.array(velocity)
    assert (walker.x, walker.y) == pytest.approx(end, abs=0.07)
    assert walker.radius == pytest.approx(0.2, abs=0.03)
    assert np.array_equal(standing, post)


@pytest.mark.parametrize(("speed", "moves"), [(0.05, False), (0.3, True), (1.8, True), (2.4, False)])
def test_what_creeps_or_is_faster_than_anybody_does_not_walk(speed, moves):
    tracks = MovingObstacles()
    for k in range(16):
        tracks.update(hits_on(2.0 + 0.1 * speed * k, -1.0), LIDAR, 0.45, 0.1 * k)
    assert bool(tracks.obstacles) == moves


def test_what_shakes_on_the_spot_or_is_too_large_does_not_walk():
    tracks = MovingObstacles()
    for k in range(20):
        tracks.update(hits_on(2.0 + 0.04 * (-1) ** k, -1.0), LIDAR, 0.45, 0.1 * k)
    assert tracks.obstacles == []
    wide = np.column_stack([np.linspace(1.5, 2.6, 23), np.full(23, 1.0)])
    for k in range(20):
        standing = tracks.update(wide + np.array([0.0, 0.05 * k]), LIDAR, 0.45, 2.0 + 0.1 * k)
    assert tracks.obstacles == []
    assert len(standing) == 23


@pytest.mark.parametrize(("speed", "moves"), [(0.09, True), (0.04, False)])
def test_a_slowing_person_counts_as_moving_down_to_half_the_threshold_speed(speed, moves):
    tracks = MovingObstacles()
    now, _ = walk(tracks, (0.0, 0.3))
    walk(tracks, (0.0, speed), (2.0, -0.4), 4.0, begin=now)
    assert bool(tracks.obstacles) == moves
    assert len(tracks.walkers) == 1


def test_a_person_that_stops_is_a_walker_at_rest_that_may_walk_on():
    tracks = MovingObstacles()
    now, _ = walk(tracks, (0.0, 0.5))
    now, standing = walk(tracks, (0.0, 0.0), (2.0, 0.0), 3.0, begin=now + 0.1)
    assert tracks.obstacles == []
    assert [(w.x, w.y) for w in tracks.walkers] == [pytest.approx((2.0, 0.0), abs=0.07)]
    assert len(standing) == 9
    walk(tracks, (0.0, -0.5), (2.0, 0.0), 1.5, begin=now + 0.1)
    assert len(tracks.obstacles) == 1


@pytest.mark.parametrize(("away", "speed", "forgotten"), [(2.0, 0.25, 0.8), (0.3, 0.2, 3.0)])
def test_a_lost_person_is_predicted_for_a_while_and_longer_in_blind_areas_of_the_lidar(away, speed, forgotten):
    """It walks across the view, and so stays about as far away."""
    tracks = MovingObstacles()
    now, _ = walk(tracks, (0.0, speed), (LIDAR[0] + away, LIDAR[1] - 2.0 * speed))
    (before,) = tracks.obstacles
    for k in range(1, 40):
        tracks.update(NOTHING, LIDAR, 0.45, now + 0.1 * k)
        passed = 0.1 * k
        if passed < forgotten - 0.05:
            (walker,) = tracks.obstacles
            assert walker.y == pytest.approx(before.y + passed * before.vy, abs=1e-6)
        elif passed > forgotten + 0.15:
            assert tracks.obstacles == [] == tracks.walkers


def test_two_who_pass_each_other_keep_their_ways_and_a_jump_is_somebody_else():
    tracks = MovingObstacles()
    for k in range(25):
        a, b = hits_on(2.0, -1.2 + 0.06 * k), hits_on(2.6, 1.2 - 0.06 * k)
        tracks.update(np.vstack([a, b]), LIDAR, 0.45, 0.1 * k)
    assert sorted(round(w.vy, 1) for w in tracks.obstacles) == [-0.6, 0.6]
    tracks = MovingObstacles()
    now, _ = walk(tracks)
    tracks.update(hits_on(2.0, 1.2), LIDAR, 0.45, now + 0.1)  # a metre further on
    (walker,) = tracks.obstacles
    assert walker.y == pytest.approx(0.26, abs=0.08)


@pytest.mark.parametrize("posts", [1, 0])
def test_hits_of_the_last_and_the_first_beam_belong_to_one_cluster(posts):
    tracks = MovingObstacles(gap=0.2 if posts else 0.12)
    for k in range(20):
        disc = hits_on(2.0, -1.0 + 0.06 * k)
        post = hits_on(1.0, 2.0, 0.15) if posts else np.zeros((0, 2))
        around = np.vstack([disc[5:], post, disc[:5]])
        standing = tracks.update(around, LIDAR, 0.45, 0.1 * k)
    (walker,) = tracks.obstacles
    assert walker.radius == pytest.approx(0.2, abs=0.03)
    assert np.array_equal(standing, post)


def test_two_hits_are_nobody():
    tracks = MovingObstacles()
    for k in range(20):
        tracks.update(hits_on(2.0, -1.0 + 0.06 * k, count=2), LIDAR, 0.45, 0.1 * k)
    assert tracks.obstacles == []
