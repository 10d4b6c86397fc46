from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.localization.pose_uncertainty import (
    deviation,
    difference,
    driven_on,
    turned,
    worst_position_std,
)


@dataclass(frozen=True)
class Noise:
    slip: float = 0.0
    turn_slip: float = 0.0
    turn_shift: float = 0.0
    drift: float = 0.0


def test_a_doubt_of_the_heading_becomes_one_of_the_place_across_the_way():
    _, covariance = driven_on(Pose2D(), np.diag([0.0, 0.0, 0.01**2]), Pose2D(3.0, 0.0, 0.0), Noise())
    assert np.sqrt(np.diag(covariance)) == pytest.approx([0.0, 0.03, 0.01])


def test_the_covariance_is_that_of_poses_drawn_and_driven_one_by_one():
    pose, moved = Pose2D(1.0, -2.0, 0.7), Pose2D(0.4, 0.1, 0.3)
    before = np.diag([0.02, 0.01, 0.03]) ** 2
    after, covariance = driven_on(pose, before, moved, Noise(slip=1e-4, turn_slip=2e-4, drift=3e-4))
    rng = np.random.default_rng(0)
    distance = math.hypot(0.4, 0.1)
    spread = np.diag([1e-4 * distance, 1e-4 * distance, 2e-4 * 0.3 + 3e-4 * distance])
    starts = rng.multivariate_normal([1.0, -2.0, 0.7], before, 40000)
    ends = np.array([(p.x, p.y, p.theta) for p in (Pose2D(*start) @ moved for start in starts)])
    ends += rng.multivariate_normal(np.zeros(3), spread, len(ends))
    assert after == pose @ moved
    assert np.cov(ends.T) == pytest.approx(covariance, rel=0.05, abs=1e-5)


def test_a_covariance_turned_a_quarter_exchanges_its_axes():
    assert turned(np.diag([4.0, 1.0, 9.0]), math.pi / 2) == pytest.approx(np.diag([1.0, 4.0, 9.0]))


def test_angles_are_compared_across_the_half_turn():
    off = difference(Pose2D(0.0, 0.0, math.pi - 0.1), Pose2D(0.0, 0.0, 0.1 - math.pi))
    assert off == pytest.approx([0.0, 0.0, -0.2])
    assert deviation(off, np.diag([1.0, 1.0, 0.1**2])) == pytest.approx(2.0)


def test_the_worst_direction_may_lie_between_the_axes():
    assert worst_position_std(turned(np.diag([0.3, 0.1, 0.0]) ** 2, 0.9)) == pytest.approx(0.3)
