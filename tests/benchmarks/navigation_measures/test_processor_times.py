from __future__ import annotations

import numpy as np

from benchmarks.navigation_measures.processor_times import timed_calls, timed_ticks
from bestman_bt.messages import LaserScan, Path2D, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower


class Follower(PathFollower):
    """Computes without end where it is told a scan, and hardly at all for a command."""

    def observe(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        np.sort(np.random.default_rng(0).random(300_000))

    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        return

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        return FollowerCommand(Twist2D(0.1, 0.0, 0.0), False, 1.0)


class Blind(Follower):
    """Inherits how it observes."""


def test_a_tick_with_a_scan_counts_the_scan_too():
    scan = LaserScan(np.ones(4), 0.0, 0.1, 0.1, 5.0, stamp=0.0)
    ticks: list[float] = []
    follower = Blind()
    with timed_ticks(Blind, ticks):
        follower.compute(Pose2D(), Twist2D(), 0.05)
        follower.observe(scan, Pose2D())
        follower.compute(Pose2D(), Twist2D(), 0.05)
        follower.compute(Pose2D(), Twist2D(), 0.05)
    assert len(ticks) == 3
    assert ticks[1] > 10.0 * max(ticks[0], ticks[2])


def test_afterwards_the_class_is_as_it_was_even_if_a_call_fails():
    before = dict(vars(Blind))
    try:
        with timed_calls(Blind, "observe", lambda seconds: None):
            assert "observe" in vars(Blind)
            raise RuntimeError("what a drive ran into")
    except RuntimeError:
        pass
    assert dict(vars(Blind)) == before
