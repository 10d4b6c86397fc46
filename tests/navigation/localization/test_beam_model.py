from __future__ import annotations

from dataclasses import replace

import numpy as np

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.localization.correlative_search import BeamModel
from tests.navigation.localization.simulated_scans import scan_at

TRUTH = Pose2D(0.2, -0.8, 0.4)
MODEL = BeamModel()


def test_a_scan_agrees_best_where_it_was_taken(kitchen):
    segments = kitchen.lidar_segments()
    lidar = Pose2D(0.1, 0.0, 0.05)
    scan = scan_at(TRUTH, segments, np.random.default_rng(1))
    right = MODEL.agreement(segments, TRUTH @ lidar, scan)
    assert right.explained > 0.98
    for off in (Pose2D(0.3, 0.0, 0.0), Pose2D(0.0, 0.0, 0.3), Pose2D(0.0, 1.0, 0.0), Pose2D(2.5, 1.0, 1.0)):
        assert MODEL.agreement(segments, TRUTH @ off @ lidar, scan).log_likelihood < right.log_likelihood - 0.5


def test_to_see_through_a_wall_is_worse_than_to_see_something_that_is_not_in_the_map(kitchen):
    lidar = Pose2D(0.1, 0.0, 0.05)
    with_wall = kitchen.lidar_segments()
    wall = with_wall[:, 0] == 1.5
    without = with_wall[~wall]
    rng = np.random.default_rng(2)
    something_more = MODEL.agreement(without, TRUTH @ lidar, scan_at(TRUTH, with_wall, rng))
    seen_through = MODEL.agreement(with_wall, TRUTH @ lidar, scan_at(TRUTH, without, rng))
    assert seen_through.log_likelihood < something_more.log_likelihood < 1.0


def test_a_blind_scan_explains_nothing(kitchen):
    scan = scan_at(TRUTH, kitchen.lidar_segments(), np.random.default_rng(3))
    blind = replace(scan, ranges=np.full(len(scan.ranges), np.inf))
    assert MODEL.agreement(kitchen.lidar_segments(), TRUTH, blind).explained == 0.0
    assert MODEL.agreement(np.empty((0, 4)), TRUTH, blind).explained == 0.0


def test_walls_beyond_the_range_of_the_lidar_are_not_expected_to_be_seen(kitchen):
    near, pose = kitchen.lidar_segments()[:3], Pose2D(0.3, 0.2, 0.5)
    far = np.array([(-20.0, -20.0, 20.0, -20.0), (20.0, -20.0, 20.0, 20.0), (-20.0, 20.0, 20.0, 20.0)])
    scan = scan_at(pose, near, np.random.default_rng(4))
    assert np.isinf(scan.ranges).any()
    assert MODEL.agreement(np.vstack([near, far]), pose, scan) == MODEL.agreement(near, pose, scan)
