from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.localization.ekf import OdometryEkf, WheelOdometry

DT = 0.025


def drive(bias: float, slip: float, seconds: float, seed: int = 1):
    """Rest, then drive in bends; the filter, its last pose, where the base was and what the wheels counted."""
    rng = np.random.default_rng(seed)
    ekf, truth, wheels = OdometryEkf(), Pose2D(), Pose2D()
    fused = Pose2D()
    for step in range(int(seconds / DT)):
        now = step * DT
        speed, rate = (0.0, 0.0) if now < 2.0 else (0.4, 0.6 * math.sin(now))
        truth = truth @ Pose2D(speed * DT, 0.0, rate * DT)
        # One wheel slips: the base seems to turn when it does not.
        wheels = wheels @ Pose2D(speed * DT, 0.0, (rate + slip * speed / 0.5) * DT)
        felt = (rate + bias) * DT + rng.normal(0.0, 0.0005 * math.sqrt(DT))
        fused = ekf.update(wheels, felt, DT)
    return ekf, fused, truth, wheels


def test_the_heading_follows_the_gyroscope_where_a_wheel_slips():
    _, fused, truth, wheels = drive(bias=0.0, slip=0.1, seconds=20.0)
    assert abs(wrap_angle(wheels.theta - truth.theta)) > 1.0
    assert abs(wrap_angle(fused.theta - truth.theta)) < math.radians(3.0)
    assert fused.distance_to(truth) < 0.1 * wheels.distance_to(truth)


def test_it_learns_the_bias_of_the_gyroscope_while_the_base_rests():
    ekf, _, _, _ = drive(bias=math.radians(0.5), slip=0.0, seconds=2.0)
    assert ekf.bias == pytest.approx(math.radians(0.5), abs=math.radians(0.05))
    assert math.sqrt(ekf.covariance[4, 4]) < 0.2 * math.radians(0.5)


def test_a_biased_gyroscope_does_not_turn_a_base_whose_wheels_hold():
    _, fused, truth, _ = drive(bias=math.radians(0.5), slip=0.0, seconds=20.0)
    assert abs(wrap_angle(fused.theta - truth.theta)) < math.radians(1.5)
    assert math.radians(0.5) * 20.0 > math.radians(9.0)


@pytest.mark.slow
def test_the_error_is_within_what_the_covariance_says():
    ratios = []
    for seed in range(20):
        ekf, fused, truth, _ = drive(bias=math.radians(0.2), slip=0.05, seconds=10.0, seed=seed)
        ratios.append(abs(wrap_angle(fused.theta - truth.theta)) / math.sqrt(ekf.covariance[2, 2]))
    assert max(ratios) < 4.0


def test_a_step_without_time_changes_nothing():
    ekf = OdometryEkf()
    first = ekf.update(Pose2D(0.1, 0.0, 0.0), 0.0, DT)
    assert ekf.update(Pose2D(0.1, 0.0, 0.0), 0.0, 0.0) == first


def test_sideways_driving_goes_sideways():
    ekf = OdometryEkf()
    pose = Pose2D()
    for step in range(1, 41):
        pose = ekf.update(Pose2D(0.0, 0.01 * step, 0.0), 0.0, DT)
    assert pose.distance_to(Pose2D(0.0, 0.4, 0.0)) < 1e-3


def test_wheels_alone_stay_what_they_are():
    wheels = Pose2D(0.3, -0.2, 1.0)
    assert WheelOdometry().update(wheels, 0.5, DT) == wheels


@pytest.mark.parametrize("start", [Pose2D(), Pose2D(3.0, -2.0, 2.8)])
def test_from_any_pose_the_wheels_are_followed_backwards_sideways_and_round_the_half_turn(start):
    ekf, wheels, truth = OdometryEkf(), start, start
    for _ in range(2):  # the second time, from where the wheels have come to
        ekf.reset(wheels)
        truth = wheels
        for move in ((-0.01, 0.0, 0.02), (0.0, 0.01, -0.02), (0.01, 0.005, 0.03)):
            for _ in range(60):
                wheels = wheels @ Pose2D(*move)
                truth = truth @ Pose2D(*move)
                fused = ekf.update(wheels, move[2], DT)
        assert fused.distance_to(truth) < 0.02
        assert abs(wrap_angle(fused.theta - truth.theta)) < 0.02
        assert abs(fused.theta) <= math.pi
        before = ekf.covariance[0, 0] + ekf.covariance[1, 1]
        assert before > 1e-4  # distances that slip are no more certain than that


def test_who_turns_further_left_than_believed_drives_further_left():
    """Errors of heading and place belong together: by the covariances, on each of the four ways out."""
    for heading in (0.3, 1.9, -2.8, -1.2):
        ekf, wheels = OdometryEkf(), Pose2D(0.0, 0.0, heading)
        ekf.reset(wheels)
        for _ in range(80):
            wheels = wheels @ Pose2D(0.01, 0.0, 0.0)
            ekf.update(wheels, 0.0, DT)
        left = np.array([-math.sin(heading), math.cos(heading)])
        assert left @ ekf.covariance[:2, 2] > 0.2 * ekf.covariance[2, 2]


def test_a_turn_of_the_wheels_that_the_gyroscope_did_not_feel_is_slip():
    ekf = OdometryEkf()
    for _ in range(80):
        pose = ekf.update(Pose2D(), 0.0, DT)
    for step in range(1, 6):  # the wheels spin: a quarter of a turn in an eighth of a second
        pose = ekf.update(Pose2D(0.0, 0.0, 0.3 * step), 0.0, DT)
    assert abs(pose.theta) < 0.01
    assert abs(ekf.bias) < 0.002


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_quarter_of_a_circle_in_long_steps_ends_on_the_circle_and_a_reset_forgets_the_doubts_of_the_way(side):
    ekf, start, turn = OdometryEkf(), Pose2D(1.0, -2.0, 2.5), side * math.pi / 32
    ekf.reset(start)
    for step in range(1, 17):
        angle = step * abs(turn)
        arc = Pose2D(math.sin(angle), side * (1.0 - math.cos(angle)), step * turn)
        fused = ekf.update(start @ arc, turn, 0.1)
    assert fused.distance_to(start @ Pose2D(1.0, side, 0.0)) < 0.01
    ekf.reset(fused)
    assert np.array_equal(ekf.covariance, OdometryEkf().covariance)
