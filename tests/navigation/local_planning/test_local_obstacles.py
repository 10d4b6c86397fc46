from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.braking import JerkLimit, safe_share
from bestman_bt.navigation.local_planning.footprint_check import FootprintCheck, FootprintMotion
from bestman_bt.navigation.local_planning.obstacle_layer import LocalObstacles
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from tests.robot_models import base_model

ANGLES = np.linspace(-math.pi, math.pi, 360, endpoint=False)
SQUARE = Footprint(np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]))


def scan_of(segments, pose, stamp=0.0):
    ranges, _ = cast_rays(segments, pose, ANGLES)
    ranges = np.where((ranges > 0.45) & (ranges < 8.0), ranges, np.inf)
    return LaserScan(ranges, -math.pi, 2 * math.pi / 360, 0.45, 8.0, stamp)


def disc(x, y, radius=0.22):
    turn = np.linspace(0.0, 2 * math.pi, 25)
    ring = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    return np.hstack([ring[:-1], ring[1:]])


def test_what_is_seen_is_marked_and_cleared_again_by_beams_that_pass_through():
    obstacles, far_wall = LocalObstacles(), np.array([(2.5, -3.0, 2.5, 3.0)])
    obstacles.update(scan_of(np.vstack([far_wall, disc(1.2, 0.0)]), Pose2D()), Pose2D())
    at = np.array([1.0], np.float32), np.array([0.0], np.float32)
    assert abs(obstacles.distance.at(*at)[0]) < 0.03
    for number in range(1, 4):
        obstacles.update(scan_of(far_wall, Pose2D(), 0.1 * number), Pose2D())
    assert obstacles.distance.at(*at)[0] > 1.0


def test_what_is_too_close_to_be_seen_is_not_cleared():
    obstacles, post = LocalObstacles(), np.array([(0.6, -0.05, 0.6, 0.05)])
    obstacles.update(scan_of(post, Pose2D()), Pose2D())
    for number in range(1, 20):
        obstacles.update(scan_of(post, Pose2D(0.25, 0.0, 0.0), 0.1 * number), Pose2D(0.25, 0.0, 0.0))
    assert len(obstacles.points)
    assert np.allclose(obstacles.points[:, 0], 0.6, atol=0.03)


def test_what_the_map_has_is_left_to_the_map(costmap, kitchen):
    obstacles, pose = LocalObstacles(), Pose2D(0.3, 0.2, 0.4)
    obstacles.use_costmap(costmap)
    obstacles.update(scan_of(np.vstack([kitchen.walls, disc(0.9, -1.2)]), pose), pose)
    assert len(obstacles.points) > 5
    assert np.linalg.norm(obstacles.points - [0.9, -1.2], axis=1).max() < 0.3
    x, y = np.array([1.45], np.float32), np.array([-1.0], np.float32)
    assert obstacles.distance.at(x, y)[0] == pytest.approx(float(costmap.distance_at([1.45, -1.0])), abs=0.02)


def test_another_map_counts_at_once_and_without_one_nothing_of_it_is_left(costmap):
    obstacles, (x, y) = LocalObstacles(), (np.array([1.45], np.float32), np.array([-1.0], np.float32))
    obstacles.centre_on(Pose2D(0.3, 0.2, 0.4))
    assert obstacles.distance.at(x, y)[0] > 5.0
    obstacles.use_costmap(costmap)
    assert obstacles.distance.at(x, y)[0] == pytest.approx(float(costmap.distance_at([1.45, -1.0])), abs=0.02)
    obstacles.use_costmap(None)
    assert obstacles.distance.at(x, y)[0] > 5.0


def test_the_grid_rolls_with_the_robot_and_keeps_what_it_has_seen():
    obstacles = LocalObstacles()
    obstacles.update(scan_of(disc(1.5, 0.5), Pose2D()), Pose2D())
    before = obstacles.points
    obstacles.centre_on(Pose2D(1.7, -0.9, 0.0))
    assert np.allclose(np.sort(before, axis=0), np.sort(obstacles.points, axis=0))


@pytest.mark.parametrize("driving", [0.0, 0.5])
def test_a_walker_is_tracked_with_its_velocity_and_a_post_is_not(driving):
    obstacles, post = LocalObstacles(), disc(1.5, 1.5, 0.1)
    noise = np.random.default_rng(3)
    for number in range(25):
        now = 0.1 * number
        pose = Pose2D(driving * now, 0.0, 0.0)
        scan = scan_of(np.vstack([post, disc(2.2, -1.2 + 0.6 * now)]), pose, now)
        noisy = scan.ranges + 0.01 * noise.standard_normal(360)
        obstacles.update(LaserScan(noisy, -math.pi, 2 * math.pi / 360, 0.45, 8.0, now), pose)
    assert len(obstacles.moving.obstacles) == 1
    walker = obstacles.moving.obstacles[0]
    assert (walker.vx, walker.vy) == pytest.approx((0.0, 0.6), abs=0.12)
    assert (walker.x, walker.y) == pytest.approx((2.2, -1.2 + 0.6 * 2.4), abs=0.08)


@pytest.mark.parametrize(
    ("point", "twist", "time"),
    [
        ([1.0, 0.0], Twist2D(0.5), 1.4),
        ([1.0, 0.0], Twist2D(-0.5), math.inf),
        ([0.0, 1.0], Twist2D(0.0, 0.5, 0.0), 1.4),
        ([0.5, 0.4], Twist2D(0.5), math.inf),
        ([0.4, 0.0], Twist2D(0.0, 0.0, 1.0), math.acos(0.75)),
    ],
)
def test_the_time_to_contact_is_that_of_the_moving_outline(point, twist, time):
    found, index = FootprintMotion(SQUARE.corners, 0.0).contact(np.array([[5.0, 5.0], point]), twist, 2.0)
    assert found == pytest.approx(time, abs=0.01)
    assert index == (1 if math.isfinite(time) else -1)


def test_the_safe_share_is_that_which_stops_in_time():
    share = safe_share(0.5, 0.15, 1.0)
    assert share * 0.15 + share**2 * 1.0 / 2 == pytest.approx(0.5)
    assert safe_share(0.7, 0.15, 1.0) == 1.0
    assert safe_share(0.0, 0.15, 1.0) == 0.0


def test_the_jerk_limit_reaches_a_velocity_without_passing_it_and_within_its_bounds():
    smooth, dt = JerkLimit(base_model().part), 0.025
    twists = [smooth.towards(Twist2D(0.6, 0.0, -1.0), dt) for _ in range(80)]
    twists += [smooth.towards(Twist2D(), dt) for _ in range(80)]
    v, w = np.array([t.vx for t in twists]), np.array([t.wz for t in twists])
    assert v.max() <= 0.6 + 1e-9
    assert v[79] == pytest.approx(0.6)
    assert v.min() > -1e-9
    assert (v[-1], w[-1]) == (0.0, 0.0)
    assert np.abs(np.diff(v)).max() / dt <= 0.6 + 1e-9
    assert np.abs(np.diff(v, 2)).max() / dt**2 <= 2 * 2.0 + 1e-6  # the last step lands on the velocity
    assert np.abs(np.diff(w, 2)).max() / dt**2 <= 2 * 10.0 + 1e-6


def test_an_arm_keeps_off_walls_and_passes_over_a_low_table_and_what_only_the_lidar_sees(kitchen):
    beside = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.1, 0.5) for z in (0.9, 1.2)])
    arm = SQUARE.carrying([beside], 0.01)
    obstacles, pose = LocalObstacles(), Pose2D(2.5, -0.9, 0.0)
    obstacles.use_costmap(Costmap.from_map(kitchen, arm))
    obstacles.update(scan_of(np.vstack([kitchen.walls, disc(2.5, 0.2)]), pose), pose)
    check, still = FootprintCheck(arm), np.zeros(1, np.float32)
    away = still + np.float32(math.pi)

    def clearance(x, y, theta):
        return check.clearance(obstacles.distance, np.array([x], np.float32), np.array([y], np.float32), theta)[0]

    assert clearance(3.4, -0.3 + 0.42, away) > 0.0  # beside the table
    assert clearance(2.5, 0.2 - 0.22 - 0.42, still) > 0.0  # beside the post
    assert clearance(2.5, 0.2 - 0.22 - 0.2, still) < 0.0
    assert clearance(2.6, -2.4 + 0.42, still) > 0.0  # beside the wall
    assert clearance(2.6, -2.4 + 0.42, away) < 0.03  # the margin of the followers
    at_the_wall = np.array([2.6], np.float32), np.array([-2.4 + 0.42], np.float32)
    assert check.touches(obstacles.distance, *at_the_wall, away, 0.03)[0][0]
    assert not check.touches(obstacles.distance, *at_the_wall, still, 0.03)[0][0]
