from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from examples.plugins.particle_filter import OdometryMotion

START = np.tile([1.0, 2.0, math.pi / 2], (20000, 1))
MODEL = OdometryMotion(turn_per_metre=0.05, drive_per_metre=0.1, still_turn=0.0, still_drive=0.0)


def test_the_mean_is_where_the_odometry_says():
    moved = MODEL.sample(START, Pose2D(0.5, 0.1, 0.3), np.random.default_rng(1))
    np.testing.assert_allclose(moved.mean(axis=0), [0.9, 2.5, math.pi / 2 + 0.3], atol=0.003)


def test_driving_spreads_the_poses_along_the_way_as_the_slip_says_and_turns_them():
    moved = MODEL.sample(START, Pose2D(1.0, 0.0, 0.0), np.random.default_rng(2))
    across, along, turn = moved.std(axis=0)
    assert along == pytest.approx(0.1, rel=0.05)
    assert across == pytest.approx(0.05, rel=0.05)
    assert turn == pytest.approx(0.05 * math.sqrt(2.0), rel=0.05)


def test_backing_up_is_no_turn_about():
    ahead = MODEL.sample(START, Pose2D(0.5, 0.0, 0.0), np.random.default_rng(3))
    back = MODEL.sample(START, Pose2D(-0.5, 0.0, 0.0), np.random.default_rng(3))
    assert back[:, 1].mean() == pytest.approx(1.5, abs=0.002)
    np.testing.assert_allclose(back.std(axis=0), ahead.std(axis=0), rtol=0.05)


def test_turning_on_the_spot_stays_on_the_spot_but_for_its_own_noise():
    moved = MODEL.sample(START, Pose2D(0.0, 0.0, 1.0), np.random.default_rng(4))
    assert moved[:, 2].std() == pytest.approx(MODEL.turn_per_turn, rel=0.05)
    assert moved[:, :2].std(axis=0).max() < 2 * MODEL.drive_per_turn


def test_standing_still_moves_nothing_but_by_the_noise_of_standing_still():
    rng = np.random.default_rng(5)
    np.testing.assert_array_equal(MODEL.sample(START, Pose2D(), rng), START)
    shaken = OdometryMotion(still_drive=0.003).sample(START, Pose2D(), rng)
    assert 0.0 < np.abs(shaken[:, :2] - START[:, :2]).max() < 0.02
