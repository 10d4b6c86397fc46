from __future__ import annotations

import math

import numpy as np

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.localization.scan_to_map import cast_rays

SQUARE = np.array([(-1, -1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1), (-1, 1, -1, -1)], dtype=float)


def test_rays_meet_the_nearest_segment_at_its_distance():
    behind = np.vstack([SQUARE, [(2, -3, 2, 3)]])
    distance, index = cast_rays(behind, Pose2D(0.25, 0.0, math.pi / 2), np.array([-math.pi / 2, 0.0, math.pi / 4]))
    np.testing.assert_allclose(distance, [0.75, 1.0, math.sqrt(2)])
    assert index.tolist() == [1, 2, 2]


def test_an_empty_map_shows_nothing():
    distance, index = cast_rays(np.empty((0, 4)), Pose2D(), np.array([0.0, 1.0]))
    assert distance.tolist() == [math.inf, math.inf]
    assert index.tolist() == [-1, -1]


def test_a_ray_that_meets_nothing_is_infinite():
    distance, index = cast_rays(SQUARE[:1], Pose2D(), np.array([math.pi / 2, 0.0]))
    assert distance.tolist() == [math.inf, math.inf]
    assert index.tolist() == [-1, -1]


def test_nothing_behind_the_ray_or_beside_a_segment_is_met():
    segment = np.array([(1.0, -0.5, 1.0, 0.5)])
    for pose, met in (
        (Pose2D(0.0, 0.4), True),
        (Pose2D(0.0, 0.6), False),
        (Pose2D(0.0, -0.6), False),
        (Pose2D(2.0), False),
    ):
        distance, index = cast_rays(segment, pose, np.array([0.0]))
        assert (distance[0], index[0]) == ((1.0, 0) if met else (math.inf, -1))
