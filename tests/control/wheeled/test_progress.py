from __future__ import annotations

import math

from bestman_bt.control.wheeled.base_controller import ProgressWatch
from bestman_bt.messages import Pose2D


def test_a_base_that_stands_is_stuck_after_the_time():
    watch = ProgressWatch(0.03, 0.05, 3.0)
    stuck = [watch.is_stuck(Pose2D(), 0.1 * step) for step in range(33)]
    assert stuck.index(True) in (30, 31)


def test_neither_the_time_of_a_pause_nor_a_slower_base_makes_it_stuck():
    watch = ProgressWatch(0.03, 0.05, 3.0)
    assert not any(watch.is_stuck(Pose2D(), now) for now in (0.0, 0.5, 60.0, 60.5))
    assert not any(watch.is_stuck(Pose2D(), 61.0 + 0.5 * step, speed_share=0.1) for step in range(10))


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
