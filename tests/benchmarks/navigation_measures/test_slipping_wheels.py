from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.navigation_measures.slipping_wheels import SlippingWheels
from bestman_bt.messages import Pose2D


class DrivingStraight:
    """Stands in for a base: each look at it comes 5 cm and a tenth of a second later."""

    model = SimpleNamespace(footprint=[(-0.3, -0.25), (0.3, -0.25), (0.3, 0.25), (-0.3, 0.25)])

    def __init__(self) -> None:
        self.steps = 0

    def odometry(self) -> Pose2D:
        self.steps += 1
        return Pose2D(0.05 * self.steps, 0.0, 0.0)

    def now(self) -> float:
        return 0.1 * self.steps


def counted(mean_slip: float, seed: int) -> tuple[float, float]:
    """Metres that the wheels count on 100 m, and radians that they believe to have turned, summed without sign."""
    base = DrivingStraight()
    wheels = SlippingWheels(base, base.now, mean_slip, seed)
    poses = [wheels.odometry() for _ in range(2000)]
    moves = [before.inverse() @ after for before, after in itertools.pairwise(poses)]
    return sum(float(np.hypot(*move.xy)) for move in moves), sum(abs(move.theta) for move in moves)


def test_wheels_that_slip_by_a_tenth_count_a_ninth_too_much_and_turns_that_were_none():
    way, turned = counted(0.1, seed=3)
    assert way == pytest.approx(100.0 / 0.9, rel=0.03)
    assert turned > 5.0
    assert counted(0.1, seed=3) == (way, turned)


def test_wheels_that_do_not_slip_report_the_truth():
    assert counted(0.0, seed=3) == pytest.approx((99.95, 0.0))
