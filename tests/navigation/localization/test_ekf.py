from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.localization.ekf import OdometryEkf, WheelOdometry

DT = 0.025


def drive(bias: float, slip: float, seconds: float, seed: int = 1):
    """Rest, then drive in bends; the last estimate, where the base was and what the wheels counted."""
    rng = np.random.default_rng(seed)
    ekf, truth, wheels = OdometryEkf(), Pose2D(), Pose2D()
    fused = ekf.start(Pose2D())
    for step in range(int(seconds / DT)):
        now = step * DT
        speed, rate = (0.0, 0.0) if now < 2.0 else (0.4, 0.6 * math.sin(now))
        truth = truth @ Pose2D(speed * DT, 0.0, rate * DT)
        # One wheel slips: the base seems to turn when it does not.
        wheels = wheels @ Pose2D(speed * DT, 0.0, (rate + slip * speed / 0.5) * DT)
        felt = (rate + bias) * DT + rng.normal(0.0, 0.0005 * math.sqrt(DT))
        fused = ekf.update(fused, wheels, felt, DT)
    return fused, truth, wheels


def test_the_heading_follows_the_gyroscope_where_a_wheel_slips():
    fused, truth, wheels = drive(bias=0.0, slip=0.1, seconds=20.0)
    assert abs(wrap_angle(wheels.theta - truth.theta)) > 1.0
    assert abs(wrap_angle(fused.pose.theta - truth.theta)) < math.radians(3.0)
    assert fused.pose.distance_to(truth) < 0.1 * wheels.distance_to(truth)


def test_it_learns_the_bias_of_the_gyroscope_while_the_base_rests():
    fused, _, _ = drive(bias=math.radians(0.5), slip=0.0, seconds=2.0)
    assert fused.bias == pytest.approx(math.radians(0.5), abs=math.radians(0.05))
    assert math.sqrt(fused.covariance[4, 4]) < 0.2 * math.radians(0.5)


def test_a_biased_gyroscope_does_not_turn_a_base_whose_wheels_hold():
    fused, truth, _ = drive(bias=math.radians(0.5), slip=0.0, seconds=20.0)
    assert abs(wrap_angle(fused.pose.theta - truth.theta)) < math.radians(1.5)
    assert math.radians(0.5) * 20.0 > math.radians(9.0)


@pytest.mark.slow
def test_the_error_is_within_what_the_covariance_says():
    ratios = []
    for seed in range(20):
        fused, truth, _ = drive(bias=math.radians(0.2), slip=0.05, seconds=10.0, seed=seed)
        ratios.append(abs(wrap_angle(fused.pose.theta - truth.theta)) / math.sqrt(fused.covariance[2, 2]))
    assert max(ratios) < 4.0


def test_a_step_without_time_changes_nothing():
    ekf = OdometryEkf()
    first = ekf.update(ekf.start(Pose2D()), Pose2D(0.1, 0.0, 0.0), 0.0, DT)
    assert ekf.update(first, Pose2D(0.1, 0.0, 0.0), 0.0, 0.0).pose == first.pose


def test_an_estimate_is_not_changed_by_the_next():
    ekf = OdometryEkf()
    start = ekf.start(Pose2D(1.0, 2.0, 0.7))
    once, again = (ekf.update(start, Pose2D(1.1, 2.0, 0.8), 0.02, DT) for _ in range(2))
    assert once.pose == again.pose
    assert np.array_equal(once.covariance, again.covariance)


def test_sideways_driving_goes_sideways():
    ekf = OdometryEkf()
    fused = ekf.start(Pose2D())
    for step in range(1, 41):
        fused = ekf.update(fused, Pose2D(0.0, 0.01 * step, 0.0), 0.0, DT)
    assert fused.pose.distance_to(Pose2D(0.0, 0.4, 0.0)) < 1e-3


def test_wheels_alone_stay_what_they_are():
    wheels = Pose2D(0.3, -0.2, 1.0)
    before = WheelOdometry().start(Pose2D())
    assert WheelOdometry().update(before, wheels, 0.5, DT).pose == wheels


@pytest.mark.parametrize("start", [Pose2D(), Pose2D(3.0, -2.0, 2.8)])
def test_from_any_pose_the_wheels_are_followed_backwards_sideways_and_round_the_half_turn(start):
    ekf, wheels, truth = OdometryEkf(), start, start
    for _ in range(2):  # the second time, from where the wheels have come to
        fused = ekf.start(wheels)
        truth = wheels
        for move in ((-0.01, 0.0, 0.02), (0.0, 0.01, -0.02), (0.01, 0.005, 0.03)):
            for _ in range(60):
                wheels = wheels @ Pose2D(*move)
                truth = truth @ Pose2D(*move)
                fused = ekf.update(fused, wheels, move[2], DT)
        assert fused.pose.distance_to(truth) < 0.02
        assert abs(wrap_angle(fused.pose.theta - truth.theta)) < 0.02
        assert abs(fused.pose.theta) <= math.pi
        before = fused.covariance[0, 0] + fused.covariance[1, 1]
        assert before > 1e-4  # distances that slip are no more certain than that


def test_a_base_that_has_turned_further_left_than_believed_drives_further_left():
    """Errors of heading and place belong together: by the covariances, on each of the four ways out."""
    for heading in (0.3, 1.9, -2.8, -1.2):
        ekf, wheels = OdometryEkf(), Pose2D(0.0, 0.0, heading)
        fused = ekf.start(wheels)
        for _ in range(80):
            wheels = wheels @ Pose2D(0.01, 0.0, 0.0)
            fused = ekf.update(fused, wheels, 0.0, DT)
        left = np.array([-math.sin(heading), math.cos(heading)])
        assert left @ fused.covariance[:2, 2] > 0.2 * fused.covariance[2, 2]


def test_a_turn_of_the_wheels_that_the_gyroscope_did_not_feel_is_slip():
    ekf = OdometryEkf()
    fused = ekf.start(Pose2D())
    for _ in range(80):
        fused = ekf.update(fused, Pose2D(), 0.0, DT)
    for step in range(1, 6):  # the wheels spin: a quarter of a turn in an eighth of a second
        fused = ekf.update(fused, Pose2D(0.0, 0.0, 0.3 * step), 0.0, DT)
    assert abs(fused.pose.theta) < 0.01
    assert abs(fused.bias) < 0.002


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_quarter_of_a_circle_in_long_steps_ends_on_the_circle(side):
    ekf, start, turn = OdometryEkf(), Pose2D(1.0, -2.0, 2.5), side * math.pi / 32
    fused = ekf.start(start)
    for step in range(1, 17):
        angle = step * abs(turn)
        arc = Pose2D(math.sin(angle), side * (1.0 - math.cos(angle)), step * turn)
        fused = ekf.update(fused, start @ arc, turn, 0.1)
    assert fused.pose.distance_to(start @ Pose2D(1.0, side, 0.0)) < 0.01
