from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from examples.plugins.particle_filter import ParticleFilter
from tests.navigation.localization.simulated_scans import BASE_FROM_LIDAR, BEAMS, grid_of, scan_at
from tests.navigation.localization.tracking import Tracking

STEP, TURN = 0.05, 0.04
"""What the base drives and turns between two scans."""


def circle(kitchen, localizer, truth: Pose2D, odometry: Pose2D, scans: int, seed: int = 1, slip: float = 0.1):
    """Drive in a circle with wheels that slip; the estimates and where the base was, and its last odometry."""
    rng = np.random.default_rng(seed)
    estimates, truths = [], []
    for _ in range(scans):
        truth = truth @ Pose2D(STEP, 0.0, TURN)
        share = 1.0 / (1.0 - rng.uniform(0.0, 2.0 * slip))
        odometry = odometry @ Pose2D(STEP * share, 0.0, TURN * share)
        localizer.predict(odometry)
        scan = scan_at(truth, kitchen.lidar_segments(), rng, noise=0.02)
        estimates.append(localizer.correct(scan, BASE_FROM_LIDAR))
        truths.append(truth)
    return estimates, truths, odometry


def errors(estimates, truths) -> np.ndarray:
    return np.array(
        [
            (estimate.pose.distance_to(truth), abs(wrap_angle(estimate.pose.theta - truth.theta)))
            for estimate, truth in zip(estimates, truths, strict=True)
        ]
    )


START = Pose2D(0.3, -1.3, 0.2)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("made_of", [lambda kitchen: kitchen, grid_of], ids=["walls", "grid"])
def test_slipping_wheels_and_a_noisy_lidar_leave_it_within_3_cm(kitchen, made_of):
    localizer = Tracking(
        ParticleFilter(made_of(kitchen)),
        Pose2D(START.x + 0.03, START.y - 0.03, START.theta + 0.02),
        Pose2D(),
        0.03,
        0.02,
    )
    estimates, truths, odometry = circle(kitchen, localizer, START, Pose2D(), 80)
    position, heading = errors(estimates, truths).mean(axis=0)
    assert position < 0.03
    assert heading < math.radians(1.0)
    assert all(estimate.match.accepted for estimate in estimates)
    assert (START @ odometry).distance_to(truths[-1]) > 0.1  # the wheels alone do not know


@pytest.mark.slow
def test_it_finds_itself_from_an_unknown_start_and_needs_fewer_particles_then(kitchen):
    localizer = Tracking(ParticleFilter(kitchen), Pose2D(), Pose2D(), 1.0, math.pi)
    spread = len(localizer.estimate.particles)
    estimates, truths, _ = circle(kitchen, localizer, START, Pose2D(), 40)
    assert spread == 20000
    assert len(localizer.estimate.particles) < 1500
    assert errors(estimates, truths)[-10:, 0].max() < 0.05


@pytest.mark.slow
def test_it_notices_that_it_was_carried_off_and_finds_itself_again(kitchen):
    localizer = Tracking(ParticleFilter(kitchen), START, Pose2D(), 0.03, 0.02)
    _, _, odometry = circle(kitchen, localizer, START, Pose2D(), 30)
    elsewhere = Pose2D(2.4, 0.6, 2.0)
    estimates, truths, _ = circle(kitchen, localizer, elsewhere, odometry, 60, seed=2)
    assert errors(estimates, truths)[0, 0] > 1.0
    assert errors(estimates, truths)[-10:, 0].max() < 0.05


@pytest.mark.slow
def test_where_it_may_be_in_several_places_it_reports_it(kitchen):
    localizer = Tracking(ParticleFilter(kitchen, independent_beams=0.5), Pose2D(), Pose2D(), 1.0, math.pi)
    scan = scan_at(START, kitchen.lidar_segments(), np.random.default_rng(3))
    estimate = localizer.correct(scan, BASE_FROM_LIDAR)
    assert not estimate.match.accepted
    assert "several places" in estimate.match.reason


def test_odometry_alone_makes_it_less_certain(kitchen):
    localizer = Tracking(ParticleFilter(kitchen), START, Pose2D(), 0.01, 0.01)
    near = localizer.predict(Pose2D(0.3, 0.0, 0.0))
    far = localizer.predict(Pose2D(2.5, 0.0, 0.0))
    assert 0.01 < near.position_std < far.position_std
    assert far.pose.distance_to(START @ Pose2D(2.5, 0.0, 0.0)) < 0.5 * far.position_std


def test_between_two_scans_the_estimate_moves_with_the_odometry(kitchen):
    localizer = Tracking(ParticleFilter(kitchen), START, Pose2D(), 0.01, 0.01)
    start = localizer.estimate
    moved = localizer.predict(Pose2D(0.04, 0.0, 0.02))
    assert moved.pose.distance_to(start.pose @ Pose2D(0.04, 0.0, 0.02)) < 1e-9


def test_a_blind_lidar_is_refused(kitchen):
    localizer = Tracking(ParticleFilter(kitchen), START, Pose2D(), 0.01, 0.01)
    blind = LaserScan(np.full(BEAMS, np.inf), -math.pi, 2 * math.pi / BEAMS, 0.1, 8.0, 0.0)
    assert "0 beams" in localizer.correct(blind, BASE_FROM_LIDAR).match.reason


@pytest.mark.slow
def test_equal_seeds_give_equal_estimates_and_others_do_not(kitchen):
    ends = []
    for seed in (1, 1, 2):
        localizer = Tracking(ParticleFilter(kitchen, seed=seed), START, Pose2D(), 0.03, 0.02)
        ends.append(circle(kitchen, localizer, START, Pose2D(), 5)[0][-1].pose)
    assert ends[0] == ends[1] != ends[2]


@pytest.mark.slow
def test_after_another_start_it_is_as_if_nothing_had_been(kitchen):
    ends = []
    particle_filter = ParticleFilter(kitchen)
    for _ in range(2):
        odometry = Pose2D(2.0, -1.0, 0.7)
        localizer = Tracking(particle_filter, START, odometry, 0.03, 0.02)
        estimates, _, _ = circle(kitchen, localizer, START, odometry, 4)
        ends.append(estimates[-1].pose)
        blind = LaserScan(np.full(BEAMS, 1.0), -math.pi, 2 * math.pi / BEAMS, 0.1, 8.0, 0.0)
        for _ in range(6):
            localizer.correct(blind, BASE_FROM_LIDAR)
    assert ends[0] == ends[1]


def test_hits_that_lie_on_nothing_are_refused_although_it_is_sure_of_its_place(kitchen):
    localizer = Tracking(ParticleFilter(kitchen), START, Pose2D(), 0.01, 0.01)
    around = LaserScan(np.full(BEAMS, 0.5), -math.pi, 2 * math.pi / BEAMS, 0.1, 8.0, 0.0)
    match = localizer.correct(around, BASE_FROM_LIDAR).match
    assert not match.accepted
    assert "of the hits lie" in match.reason
