from __future__ import annotations

import math

from bestman_bt.control.wheeled.base_controller import ProgressWatch
from bestman_bt.messages import Pose2D


def test_a_base_that_stands_is_stuck_after_the_time():
    watch = ProgressWatch(0.03, 0.05, 3.0)
    assert [watch.is_stuck(Pose2D(), now) for now in (0.0, 2.9, 3.1)] == [False, False, True]


def test_slow_progress_is_progress():
    watch = ProgressWatch(0.03, 0.05, 3.0)
    assert not any(watch.is_stuck(Pose2D(0.015 * second, 0.0, 0.0), second) for second in range(20))


def test_turning_on_the_spot_is_progress():
    watch = ProgressWatch(0.03, 0.05, 3.0)
    assert not any(watch.is_stuck(Pose2D(0.0, 0.0, 0.03 * second), second) for second in range(20))


def test_trembling_about_half_a_turn_is_no_progress():
    watch = ProgressWatch(0.03, 0.05, 3.0)
    headings = [math.pi - 0.01, 0.01 - math.pi] * 3
    stuck = [watch.is_stuck(Pose2D(0.0, 0.0, heading), second) for second, heading in enumerate(headings)]
    assert stuck == [False] * 4 + [True] * 2
