"""Scan matching: point-to-line ICP, and correlative search over a pyramid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.navigation.slam.correlative import CorrelativeMatcher, LikelihoodPyramid, SearchWindow
from bestman_bt.navigation.slam.loop_closure import LoopCloser
from bestman_bt.navigation.slam.point_to_line import LineReference, OrientedPoints, PointToLine, oriented_points
from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph
from bestman_bt.navigation.slam.submap import Keyframe, Submap


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


@pytest.mark.parametrize("guess", [Pose2D(0.2, -0.15, 0.1), Pose2D(-0.6, 0.1, 0.0), Pose2D(0.1, -0.6, 0.0)])
def test_branch_and_bound_finds_what_trying_every_pose_finds(still, guess):
    """Also where the best place lies beyond the window."""
    reference, scan = still
    hits, window = scan.points[::7], SearchWindow(0.4, 0.15)
    levels = [
        CorrelativeMatcher(reference.points, LikelihoodPyramid(levels=levels, min_score=0.05)).search(
            hits, guess, window
        )
        for levels in (1, 4)
    ]
    assert levels[0] is not None
    assert levels[1].score == pytest.approx(levels[0].score, abs=1e-9)


def test_nothing_is_found_where_nothing_fits(still):
    reference, scan = still
    far = SearchWindow(0.5, 0.1)
    assert CorrelativeMatcher(reference.points).search(scan.points, Pose2D(30.0, 0.0, 0.0), far) is None


def wall(x: float, height: float = 4.0, count: int = 80) -> OrientedPoints:
    """A wall across x, seen from the left."""
    points = np.column_stack([np.full(count, x), np.linspace(0.0, height, count)])
    return OrientedPoints(points, np.tile([-1.0, 0.0], (count, 1)))


def keyframe(node: int, hits: OrientedPoints, heading: float = 0.0) -> Keyframe:
    local = Pose2D(theta=heading)
    return Keyframe(node, local, LaserScan(np.ones(4), 0.0, 0.1, 0.1, 9.0, 0.0), Pose2D(), hits)


def test_a_submap_is_searched_with_what_was_inserted_last():
    submap = Submap(PointToLine(), LikelihoodPyramid(), 0.03)
    submap.insert(keyframe(0, wall(1.0)))
    near, far = wall(1.0).points, wall(5.0, 2.0).points
    window = SearchWindow(0.2, 0.05)
    assert submap.matcher.search(near, Pose2D(), window) is not None
    assert submap.matcher.search(far, Pose2D(), window) is None
    submap.insert(keyframe(1, wall(5.0, 2.0)))
    assert submap.matcher.search(far, Pose2D(), window) is not None
    assert len(submap.cloud) > len(near)


def test_how_sure_a_closure_is_is_reported_in_the_frame_of_the_keyframe():
    """A long wall and a short one say more across the long one, which the keyframe sees at half a right angle."""
    short = np.column_stack([np.linspace(0.0, 1.0, 12), np.full(12, 4.0)])
    room = OrientedPoints(
        np.vstack([wall(1.0, 4.0, 300).points, short]),
        np.vstack([wall(1.0, 4.0, 300).normals, np.tile([0.0, -1.0], (12, 1))]),
    )
    turned = Pose2D(0.0, 0.0, math.pi / 4)
    graph = PoseGraph()
    for node in range(20):
        graph.add_pose(turned if node == 19 else Pose2D())
        if node:
            before = graph.pose(node - 1).inverse() @ graph.pose(node)
            graph.add_constraint(Constraint(node - 1, node, before, np.diag([1e6, 1e6, 1e6])))
    submap = Submap(PointToLine(), LikelihoodPyramid(), 0.01)
    submap.insert(keyframe(0, room))
    seen = room.placed(turned.inverse())
    hits_alone = LoopCloser(position_std=0.0, heading_std=0.0)
    (closure,) = hits_alone.find(keyframe(19, seen, turned.theta), [submap], graph)
    across = np.array([math.cos(math.pi / 4), -math.sin(math.pi / 4)])  # x of the submap in the keyframe
    along = np.array([across[1], -across[0]])
    information = closure.information[:2, :2]
    assert across @ information @ across > 1.5 * (along @ information @ along)
