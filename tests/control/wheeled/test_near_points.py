"""What a lidar has seen close by stays where it was while the base drives on, blind to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.wheeled.collision_monitor import EDGE, MEMORY, NearPoints
from bestman_bt.messages import LaserScan, Pose2D

BLIND, BEAMS = 0.5, 360
BASE_FROM_LIDAR = Pose2D(0.1, -0.05, 0.8)


def scan_of(points: np.ndarray, odometry: Pose2D, stamp: float = 0.0, beams: int = BEAMS) -> LaserScan:
    """What a lidar sees, at ``odometry``, of points (N, 2) in the odometry frame; nothing within ``BLIND`` metres."""
    own = (odometry @ BASE_FROM_LIDAR).inverse().apply(points)
    ranges = np.full(beams, np.inf)
    bearing = np.round((np.arctan2(own[:, 1], own[:, 0]) + math.pi) / (2 * math.pi) * BEAMS).astype(int) % BEAMS
    away = np.hypot(own[:, 0], own[:, 1])
    seen = (away >= BLIND) & (bearing < beams)
    ranges[bearing[seen]] = away[seen]
    return LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, BLIND, 8.0, stamp)


def nearest(points: np.ndarray, place: np.ndarray) -> float:
    return float(np.linalg.norm(points - place, axis=1).min()) if len(points) else math.inf


def test_a_hit_is_reported_in_the_frame_of_the_base_wherever_that_has_gone_since():
    near, post = NearPoints(0.04), np.array([[3.0, 2.0]])
    there, here = Pose2D(1.0, 1.0, -2.5), Pose2D(1.6, 0.7, 1.1)
    near.update(scan_of(post, there), BASE_FROM_LIDAR, there)
    for odometry in (there, here):
        assert nearest(near.around(odometry), odometry.inverse().apply(post[0])) < 0.03


def drive_up_to(near: NearPoints, post: np.ndarray) -> Pose2D:
    """Drive towards ``post`` until it is within the blind zone; the last odometry."""
    for k, gap in enumerate((0.9, 0.7, BLIND + 0.02, 0.4)):
        odometry = Pose2D(post[0, 0] - gap, post[0, 1], 0.0) @ BASE_FROM_LIDAR.inverse()
        near.update(scan_of(post, odometry, 0.1 * k), BASE_FROM_LIDAR, odometry)
    return odometry


def test_what_has_become_too_close_to_be_seen_is_remembered_for_so_long():
    post = np.array([[2.0, -1.0]])
    for stamp, remembered in ((0.2 + MEMORY - 0.1, True), (0.2 + MEMORY + 0.1, False)):
        near = NearPoints(0.04)
        odometry = drive_up_to(near, post)
        assert nearest(near.around(odometry), odometry.inverse().apply(post[0])) < 0.03
        near.update(scan_of(post, odometry, stamp), BASE_FROM_LIDAR, odometry)
        kept = nearest(near.around(odometry), odometry.inverse().apply(post[0])) < 0.03
        assert kept == remembered


def test_what_would_be_seen_again_and_is_not_has_gone_and_what_is_still_there_stays():
    post = np.array([[2.0, -1.0]])
    for there in (True, False):
        near = NearPoints(0.04)
        odometry = drive_up_to(near, post) @ BASE_FROM_LIDAR @ Pose2D(-0.3, 0.0, 0.0) @ BASE_FROM_LIDAR.inverse()
        near.update(scan_of(post if there else post + 50.0, odometry, 1.0), BASE_FROM_LIDAR, odometry)
        assert (nearest(near.around(odometry), odometry.inverse().apply(post[0])) < 0.04) == there


def test_at_the_edge_of_the_blind_zone_a_beam_that_passes_clears_what_was_remembered():
    post = np.array([[2.0, -1.0]])
    for gap, passes, kept in ((BLIND + 0.01, True, False), (BLIND + 0.01, False, True), (BLIND - 0.01, True, True)):
        near = NearPoints(0.04)
        drive_up_to(near, post)
        odometry = Pose2D(post[0, 0] - gap, post[0, 1], 0.0) @ BASE_FROM_LIDAR.inverse()
        scan = scan_of(post + 50.0, odometry, 0.5)
        # Where a beam does not pass, something hides the place: it ends just before it.
        ranges = np.full(BEAMS, 3.0 if passes else gap + EDGE - 0.005)
        scan = LaserScan(ranges, scan.angle_min, scan.angle_increment, BLIND, 8.0, 0.5)
        near.update(scan, BASE_FROM_LIDAR, odometry)
        remembered = near.around(odometry)
        at = odometry.inverse().apply(post[0])
        assert (nearest(remembered, at) < 0.012) == kept, (gap, passes)


def test_of_what_is_blind_the_latest_is_kept_for_each_beam():
    near, odometry = NearPoints(0.04), Pose2D(0.4, 0.3, 1.0)
    lidar = odometry @ BASE_FROM_LIDAR
    for stamp, gap in ((1.0, 0.30), (2.0, 0.35), (0.5, 0.25)):
        felt = odometry.inverse().apply(lidar.apply(np.array([[gap, 0.0]])))
        near.note(felt, odometry, stamp)
    near.update(scan_of(np.zeros((0, 2)), odometry, 3.0), BASE_FROM_LIDAR, odometry)
    (kept,) = lidar.inverse().apply(odometry.apply(near.around(odometry)))
    assert kept == pytest.approx([0.35, 0.0], abs=1e-9)


def test_what_was_felt_stays_where_it_was_when_the_base_turns_away():
    near, odometry = NearPoints(0.04), Pose2D(1.0, -2.0, 2.5)
    near.note(np.array([[0.3, 0.1]]), odometry, 0.0)
    turned = odometry @ Pose2D(0.0, 0.0, math.pi / 2)
    assert near.around(turned)[0] == pytest.approx([0.1, -0.3])


def test_a_lidar_that_does_not_look_all_round_forgets_nothing_beside_its_view():
    near, odometry = NearPoints(0.04), Pose2D()
    lidar = odometry @ BASE_FROM_LIDAR
    beside = lidar.apply(np.array([[0.0, 0.51]]))  # a beam that this lidar does not have
    near.note(beside, odometry, 0.0)
    half = LaserScan(np.full(180, 4.0), -math.pi, 2 * math.pi / BEAMS, BLIND, 8.0, 1.0)
    near.update(half, BASE_FROM_LIDAR, odometry)
    assert nearest(near.around(odometry), beside[0]) < 1e-9


def test_noise_along_a_surface_is_averaged_and_edges_are_not():
    ranges = np.full(BEAMS, np.inf)
    ranges[100:110] = 2.0 + 0.015 * np.array([1, -1] * 5)
    ranges[110:120] = 2.1
    near = NearPoints(0.04)
    near.update(LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, BLIND, 8.0, 0.0), Pose2D(), Pose2D())
    away = np.sort(np.linalg.norm(near.around(Pose2D()), axis=1))
    assert len(away) == 20
    assert away[:10].min() > 1.99
    assert away[:10].max() < 2.01
    assert away[10:] == pytest.approx(2.1)
