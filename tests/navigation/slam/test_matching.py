"""Scan matching: point-to-line ICP, and correlative search over a pyramid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.slam import (
    CorrelativeMatcher,
    CorrelativeParameters,
    LineReference,
    SearchWindow,
    oriented_points,
)


def simulated(drive, index):
    return oriented_points(drive.scans[index], Pose2D(0.1, 0.0, 0.05))


@pytest.fixture(scope="module")
def still(round_drive):
    """The first scan as a reference, and the next one, taken in the same place."""
    return simulated(round_drive, 0), simulated(round_drive, 1)


def test_normals_are_square_to_the_walls_and_face_the_lidar(still):
    points, normals = still[0].points, still[0].normals
    assert len(points) > 250
    assert (np.einsum("ij,ij->i", normals, points - (0.1, 0.0)) < 0.0).all()
    # All walls are parallel to an axis of the map; the first pose looks north.
    angles = np.degrees(np.arctan2(normals[:, 1], normals[:, 0]))
    off = np.abs((angles + 45.0) % 90.0 - 45.0)
    assert np.median(off) < 4.0


@pytest.mark.parametrize("offset", [Pose2D(0.1, -0.08, 0.06), Pose2D(-0.05, 0.12, -0.1), Pose2D()])
def test_icp_finds_back_to_millimetres_from_a_guess_that_is_decimetres_off(still, offset):
    reference, scan = still
    found = LineReference(reference).align(scan, offset)
    assert math.hypot(found.pose.x, found.pose.y) < 0.006
    assert abs(found.pose.theta) < math.radians(0.3)
    assert found.inlier_ratio > 0.9
    assert found.residual < 0.02


def test_icp_weighs_the_guess_where_a_corridor_tells_nothing_along_it():
    x = np.linspace(-3.0, 3.0, 300)
    from bestman_bt.navigation.slam.oriented_points import OrientedPoints

    corridor = OrientedPoints(
        np.vstack([np.column_stack([x, np.full(300, side)]) for side in (-0.6, 0.6)]),
        np.vstack([np.tile([0.0, -np.sign(side)], (300, 1)) for side in (-0.6, 0.6)]),
    )
    guess = Pose2D(0.20, 0.05, 0.02)
    found = LineReference(corridor).align(corridor, guess, np.diag([1e4, 1e4, 1e4]))
    assert found.pose.x == pytest.approx(0.20, abs=0.005)
    assert abs(found.pose.y) < 0.003
    assert found.information[0, 0] < 1e-3 * found.information[1, 1]


def test_the_two_faces_of_a_thin_wall_are_not_mistaken_for_each_other():
    from bestman_bt.navigation.slam.oriented_points import OrientedPoints

    y = np.linspace(-1.0, 1.0, 100)
    left = OrientedPoints(np.column_stack([np.zeros(100), y]), np.tile([-1.0, 0.0], (100, 1)))
    right = OrientedPoints(np.column_stack([np.full(100, 0.1), y]), np.tile([1.0, 0.0], (100, 1)))
    # The right face seen 6 cm too far left lies nearer to the left face, but faces the other way.
    found = LineReference(
        OrientedPoints(np.vstack([left.points, right.points]), np.vstack([left.normals, right.normals]))
    ).align(right, Pose2D(-0.06, 0.0, 0.0))
    assert found.pose.x == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize("away", [(0.8, -0.6, 0.3), (-1.1, 0.4, -0.25)])
def test_correlative_search_finds_jumps_that_icp_cannot(still, away):
    reference, scan = still
    guess = Pose2D(*away)
    assert LineReference(reference).align(scan, guess).inlier_ratio < 0.8
    found = CorrelativeMatcher(reference.points).search(scan.points, guess, SearchWindow(1.3, 0.4))
    assert math.hypot(found.pose.x, found.pose.y) < 0.06
    assert abs(wrap_angle(found.pose.theta)) < 0.03
    assert found.score > 0.8


def test_branch_and_bound_finds_what_trying_every_pose_finds(still):
    reference, scan = still
    hits, guess, window = scan.points[::7], Pose2D(0.2, -0.15, 0.1), SearchWindow(0.4, 0.15)
    levels = [
        CorrelativeMatcher(reference.points, CorrelativeParameters(levels=levels)).search(hits, guess, window)
        for levels in (1, 4)
    ]
    assert levels[0] is not None
    assert levels[1].score == pytest.approx(levels[0].score, abs=1e-9)


def test_nothing_is_found_where_nothing_fits(still):
    reference, scan = still
    far = SearchWindow(0.5, 0.1)
    assert CorrelativeMatcher(reference.points).search(scan.points, Pose2D(30.0, 0.0, 0.0), far) is None
