"""When a base counts as settled, as lost and as knowing where it is, by what a scripted localisation says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.control.lidar import deskewed
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle, Localising, PlacedScan
from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, ScanMatch
from bestman_bt.world_model.world_model import BasePose
from hal.api import NoDataError

STILL = Pose2D()
BASE_FROM_LIDAR = Pose2D(0.2, 0.1, 0.5)
START = BasePose(Pose2D(1.0, 2.0, 2.0), 0.02, 0.03, 0.0)
SCAN = LaserScan(np.full(4, 2.0), -1.0, 0.5, 0.1, 8.0, 0.0)
LOCALISING = Localising(rate=40.0, scan_every=4, settle_scans=3, rest_scan_every=12, lost_scans=2)


class Scripted(Localizer):
    """Adds what the odometry has moved; scans fit while ``fits``, and its position is known up to ``std``."""

    def __init__(self) -> None:
        self.fits, self.std = True, 0.05
        self.begun: list[tuple[Pose2D, Pose2D, float, float]] = []
        self.match: ScanMatch | None = None
        self.corrections = 0

    def start(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> LocalizationEstimate:
        self.begun.append((pose, odometry, position_std, heading_std))
        self.match, self._pose, self._last = None, pose, odometry
        return self._estimate()

    def predict(self, before: LocalizationEstimate, odometry: Pose2D) -> LocalizationEstimate:
        self._pose, self._last = self._pose @ (self._last.inverse() @ odometry), odometry
        return self._estimate()

    def correct(self, before: LocalizationEstimate, scan: LaserScan, base_from_lidar: Pose2D) -> LocalizationEstimate:
        self.corrections += 1
        self.match = ScanMatch(self.fits, 0.9, 0.01, "" if self.fits else "few hits")
        return self._estimate()

    def _estimate(self) -> LocalizationEstimate:
        return LocalizationEstimate(self._pose, np.diag([self.std**2, 1e-6, 0.04**2]), self.match)


class Cycle:
    """The cycle of a base whose odometry a test moves."""

    def __init__(self, believed: BasePose = START) -> None:
        self.odometry = Pose2D(-3.0, 1.0, -1.0)
        self.world: Any = SimpleNamespace(base=believed)
        self.seen: list[PlacedScan] = []
        self.localizer = Scripted()
        odometer: Any = SimpleNamespace(begin=lambda: None, end=lambda: None, pose=lambda: self.odometry)
        self.now, self.latency = 7.5, 0.0
        lidar: Any = SimpleNamespace(
            scan=lambda: replace(SCAN, stamp=self.now - self.latency), base_from_lidar=BASE_FROM_LIDAR
        )
        clock: Any = SimpleNamespace(now=lambda: self.now)
        self.cycle = LocalisationCycle(clock, lidar, self.localizer, odometer, self.world, LOCALISING, self.seen.append)
        self.cycle.begin()

    def steps(self, count: int, by: Pose2D = STILL) -> None:
        for _ in range(count):
            self.odometry = self.odometry @ by
            self.now += 1.0 / LOCALISING.rate
            self.cycle.step()


def test_the_belief_begins_where_it_was_and_goes_with_the_odometry_and_scans_are_where_the_lidar_was() -> None:
    base = Cycle()
    assert base.localizer.begun == [(START.pose, base.odometry, 0.02, 0.03)]
    base.steps(4, Pose2D(0.1, 0.0, 0.1))
    where = START.pose
    for _ in range(4):
        where = where @ Pose2D(0.1, 0.0, 0.1)
    believed = base.world.base
    assert [*believed.pose.xy, believed.pose.theta] == pytest.approx([*where.xy, where.theta])
    assert (believed.position_std, believed.heading_std, believed.stamp) == pytest.approx((0.05, 0.04, 7.6))
    (seen,) = base.seen
    lidar = where @ BASE_FROM_LIDAR
    assert [*seen.map_from_lidar.xy, seen.map_from_lidar.theta] == pytest.approx([*lidar.xy, lidar.theta])
    assert (seen.scan.stamp, seen.odometry, seen.fits) == (base.now, base.odometry, True)


def test_a_base_that_rests_has_settled_after_its_scans_and_then_looks_less_often() -> None:
    base = Cycle()
    for scans in (1, 2, 3):
        assert not base.cycle.settled
        base.steps(4)
        assert len(base.seen) == scans
    assert base.cycle.settled
    base.steps(11)
    assert len(base.seen) == 3
    base.steps(1)
    assert len(base.seen) == 4
    base.cycle.look_again()
    assert not base.cycle.settled
    base.steps(4)
    assert len(base.seen) == 5


@pytest.mark.parametrize(
    ("by", "moves"),
    [
        (Pose2D(0.00026), True),
        (Pose2D(0.0, -0.00026), True),
        (Pose2D(0.0, 0.0, -0.00026), True),
        (Pose2D(0.00024, 0.0, 0.00024), False),
    ],
)
def test_what_moves_faster_than_the_limits_of_rest_has_not_settled(by: Pose2D, moves: bool) -> None:
    base = Cycle()
    base.steps(20, by)
    assert base.cycle.settled is not moves


def test_so_many_scans_in_a_row_that_do_not_fit_and_it_no_longer_knows_where_it_is() -> None:
    base = Cycle()
    base.localizer.fits = False
    base.steps(4)
    assert base.cycle.is_localized
    base.localizer.fits = True
    base.steps(4)
    base.localizer.fits = False
    base.steps(4)
    assert base.cycle.is_localized, "the one that fitted has made good the one before"
    base.steps(12)
    assert not base.cycle.is_localized
    assert "pose of the base is too uncertain (±0.05 m: few hits)" in base.cycle.lost_reason
    assert [scan.fits for scan in base.seen] == [False, True, False, False]
    base.cycle.look_again()
    assert not base.cycle.is_localized
    base.cycle.look_again(forgive=True)
    assert base.cycle.is_localized


@pytest.mark.parametrize(("std", "knows"), [(0.0999, True), (0.1001, False)])
def test_an_uncertain_estimate_is_none_to_drive_by(std: float, knows: bool) -> None:
    base = Cycle()
    base.localizer.std = std
    base.steps(1)
    assert base.cycle.is_localized is knows
    assert ("pose of the base is too uncertain" in base.cycle.lost_reason) is not knows


def test_a_given_start_pose_is_doubted_if_no_scan_has_ever_matched() -> None:
    base = Cycle()
    assert "no scan fits at the given pose of the base (odometry alone)" in base.cycle.lost_reason
    base.localizer.fits = False
    base.steps(8)
    assert "no scan fits at the given pose of the base (few hits)" in base.cycle.lost_reason


@pytest.mark.parametrize(("std", "lost"), [(0.0999, False), (0.1001, True)])
def test_a_base_is_lost_from_an_uncertain_beginning_until_a_scan_fits(std: float, lost: bool) -> None:
    base = Cycle(BasePose(START.pose, std, 0.03, 0.0))
    assert base.cycle.lost is lost
    base.localizer.fits = False
    base.steps(4)
    assert base.cycle.lost is lost
    base.localizer.fits = True
    base.steps(4)
    assert not base.cycle.lost


def test_told_another_place_it_begins_anew_and_is_lost_until_a_scan_fits_there() -> None:
    base = Cycle()
    base.steps(12)
    base.localizer.fits = False
    base.steps(24)
    assert not base.cycle.is_localized
    elsewhere = BasePose(Pose2D(5.0, 5.0, 1.0), 0.03, 0.05, 8.0)
    base.cycle.believe(elsewhere)
    assert base.world.base is elsewhere
    assert base.localizer.begun[-1] == (elsewhere.pose, base.odometry, 0.03, 0.05)
    assert base.cycle.lost
    assert not base.cycle.settled
    assert base.cycle.is_localized, "what did not fit elsewhere counts no longer"
    assert "no scan fits at the given pose of the base" in base.cycle.lost_reason
    base.localizer.fits = True
    base.steps(4)
    assert not base.cycle.lost


@pytest.mark.parametrize("by", [Pose2D(0.02, 0.005, 0.03), Pose2D(-0.01, 0.0, -0.04)])
def test_a_late_scan_is_placed_where_the_lidar_was_when_it_was_taken(by: Pose2D) -> None:
    base = Cycle()
    base.latency = 0.0625  # two and a half control ticks
    base.steps(8, by)
    then = base.odometry
    for _ in range(3):
        then = then @ by.inverse()
    middle = then @ Pose2D(by.x / 2, by.y / 2, by.theta / 2)
    seen = base.seen[-1]
    assert [*seen.odometry.xy, seen.odometry.theta] == pytest.approx([*middle.xy, middle.theta], abs=3e-4)
    where = base.world.base.pose @ base.odometry.inverse() @ seen.odometry
    lidar = where @ BASE_FROM_LIDAR
    assert [*seen.map_from_lidar.xy, seen.map_from_lidar.theta] == pytest.approx([*lidar.xy, lidar.theta])
    at = base.cycle.pose_at(base.now - base.latency)
    assert [*at.xy, at.theta] == pytest.approx([*where.xy, where.theta])


@pytest.mark.parametrize(("latency", "words"), [(2.6, "before the oldest"), (-0.3, "0.30 s after the newest")])
def test_a_scan_of_a_time_that_no_odometry_tells_of_is_refused(latency: float, words: str) -> None:
    base = Cycle()
    base.steps(120)
    scans = len(base.seen)
    base.latency = latency
    base.steps(5 * 12)
    assert len(base.seen) == scans, "left out"
    with pytest.raises(NoDataError, match=words):
        base.steps(12)
    with pytest.raises(NoDataError, match=words):
        base.cycle.scan()
    base.latency = 0.0
    base.steps(12)
    assert len(base.seen) == scans + 1


def test_the_sweep_of_a_lidar_that_moves_is_straightened() -> None:
    """A wall 2 m ahead, seen by a lidar that drives towards it and turns while it sweeps."""
    count, sweep = 181, 0.1
    moved = Pose2D(0.08, 0.0, 0.1)
    angles = np.linspace(-0.5, 0.5, count)
    share = np.arange(count) / count
    ranges = (2.0 - share * moved.x) / np.cos(angles + share * moved.theta)
    skewed = LaserScan(ranges, -0.5, 1.0 / (count - 1), 0.1, 8.0, 3.0, sweep / count)
    assert np.ptp(skewed.points()[:, 0]) > 0.05
    straight = deskewed(skewed, moved)
    points = straight.points()
    assert len(points) > 150
    assert points[:, 0] == pytest.approx(2.0, abs=0.008)  # a hit moves to the middle of a beam, 3 mrad wide
    assert (straight.stamp, straight.time_increment) == (3.0, 0.0)
