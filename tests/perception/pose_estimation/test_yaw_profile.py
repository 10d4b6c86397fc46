from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.perception.pose_estimation.yaw_profile import YawProfile


def profile(**open_degrees: object) -> YawProfile:
    """72 yaws; likelihood 0 in the given degrees, -100 elsewhere."""
    degrees = np.arange(72) * 5
    taken = np.isin(degrees, open_degrees["taken"])
    return YawProfile(np.radians(degrees), np.zeros((72, 2)), np.where(taken, 0.0, -100.0))


def test_neighbouring_yaws_form_one_arc_over_the_end_of_the_circle() -> None:
    arcs = profile(taken=[350, 355, 0, 5]).plausible_yaws(10.0, 0.0, 0.01).arcs
    assert len(arcs) == 1
    assert math.degrees(arcs[0][0]) == pytest.approx(-2.5)
    assert math.degrees(arcs[0][1]) == pytest.approx(10.0)


def test_the_arc_of_the_likeliest_yaw_comes_first() -> None:
    yaws = profile(taken=[0, 5, 100, 105, 110]).plausible_yaws(10.0, math.radians(104.0), 0.01)
    assert [round(math.degrees(middle), 1) for middle, _ in yaws.arcs] == [105.0, 2.5]
    assert math.degrees(yaws.width) == pytest.approx(25.0)


def test_where_nothing_speaks_against_a_yaw_the_whole_circle_is_open() -> None:
    yaws = profile(taken=range(0, 360, 5)).plausible_yaws(10.0, 1.0, 0.01)
    assert yaws.width == pytest.approx(2 * math.pi)
    assert yaws.contains(-2.0)


def test_starts_are_the_peaks_within_the_margin_best_first() -> None:
    degrees = np.arange(72) * 5
    likelihood = -np.minimum(np.abs(degrees - 100) / 5.0, 5.0 + np.abs(degrees - 200) / 5.0)
    found = YawProfile(np.radians(degrees), np.zeros((72, 2)), likelihood).starts(10.0, 3)
    assert [round(math.degrees(start[2])) for start in found] == [100, 200]
    assert len(YawProfile(np.radians(degrees), np.zeros((72, 2)), likelihood).starts(2.0, 3)) == 1


def test_a_gap_of_one_yaw_between_open_ones_is_open() -> None:
    assert len(profile(taken=[40, 45, 55, 60]).plausible_yaws(10.0, math.radians(45.0), 0.01).arcs) == 1
    assert len(profile(taken=[40, 45, 60, 65]).plausible_yaws(10.0, math.radians(45.0), 0.01).arcs) == 2


def test_the_first_arc_holds_the_refined_yaw_with_its_error() -> None:
    yaws = profile(taken=[100]).plausible_yaws(10.0, math.radians(103.0), math.radians(1.0))
    assert yaws.contains(math.radians(106.4))
    assert yaws.contains(math.radians(97.6))
    assert not yaws.contains(math.radians(107.0))
