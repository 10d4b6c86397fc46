from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.navigation.local_planning.swept_path import SweptPath

LONG = FootprintMotion(np.array([[-0.4, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.4, 0.2]]), 0.0)
AHEAD = Path2D(np.array([[0.0, 0.0], [2.0, 0.0]]), Pose2D(2.0, 0.0, 0.0))


def contact(path: Path2D, *points: tuple[float, float], here: tuple[float, float, float] = (0.0, 0.0, 0.0)):
    return SweptPath(path).contact(np.array(here), np.array(points), LONG)


def test_a_point_on_the_path_is_touched_by_the_front_of_the_base():
    found = contact(AHEAD, (1.5, 0.1))
    assert found is not None
    ahead, point = found
    assert ahead == pytest.approx(1.1, abs=0.06)
    assert point.tolist() == [1.5, 0.1]


def test_points_beside_the_path_leave_it_free():
    assert contact(AHEAD, (1.0, 0.21), (1.0, -0.21), (2.45, 0.0)) is None


def test_of_two_points_the_first_one_on_the_way_is_reported():
    assert contact(AHEAD, (2.0, 0.0), (1.0, 0.0))[1].tolist() == [1.0, 0.0]


@pytest.mark.parametrize(("heading", "touches"), [(0.0, False), (math.pi / 2, True)])
def test_the_turn_to_the_goals_heading_sweeps_its_surroundings(heading, touches):
    path = Path2D(AHEAD.points, Pose2D(2.0, 0.0, heading))
    assert (contact(path, (2.0, 0.3)) is not None) == touches


def test_the_turn_at_a_corner_sweeps_its_surroundings_too():
    corner = Path2D(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]), Pose2D(2.0, 2.0, math.pi / 2))
    assert contact(corner, (2.3, 0.3)) is not None
    assert contact(AHEAD, (2.3, 0.3)) is None


def test_what_has_been_passed_no_longer_counts():
    swept = SweptPath(AHEAD)
    for x in np.arange(0.0, 1.6, 0.2):
        swept.advance(np.array([x, 0.0]))
    assert swept.remaining == pytest.approx(0.6, abs=0.05)
    assert swept.contact(np.array([1.4, 0.0, 0.0]), np.array([[0.9, 0.0]]), LONG) is None


def test_a_base_that_touches_a_point_already_may_drive_away_from_it_and_not_into_it():
    assert contact(AHEAD, (-0.38, 0.0)) is None
    assert contact(AHEAD, (0.38, 0.0)) is not None


def test_backwards_it_is_the_rear_that_comes_first():
    long_behind = FootprintMotion(np.array([[-0.6, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.6, 0.2]]), 0.0)
    back = Path2D(np.array([[0.0, 0.0], [-1.0, 0.0]]), Pose2D(-1.0, 0.0, 0.0), np.array([True]))
    ahead, _ = SweptPath(back).contact(np.zeros(3), np.array([[-1.2, 0.0]]), long_behind)
    assert ahead == pytest.approx(0.6, abs=0.06)


def test_progress_does_not_jump_to_a_later_strand_close_by():
    hairpin = Path2D(np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 0.1], [0.0, 0.1]]), Pose2D(0.0, 0.1, math.pi))
    swept = SweptPath(hairpin)
    for x in np.arange(0.0, 2.0, 0.2):
        swept.advance(np.array([x, 0.07]))
    assert swept.remaining == pytest.approx(12.1 - 1.8, abs=0.06)


def test_metres_until_a_contact_count_from_where_the_base_has_come_to():
    for driven in (0.0, 0.6, 1.0):
        swept = SweptPath(Path2D(np.array([[0.0, 0.0], [4.0, 0.0]]), Pose2D(4.0, 0.0, 0.0)))
        for x in np.arange(0.0, driven + 0.01, 0.2):
            swept.advance(np.array([x, 0.0]))
        metres, _ = swept.contact(np.array([driven, 0.0, 0.0]), np.array([[3.0, 0.0]]), LONG)
        assert metres == pytest.approx(2.6 - driven, abs=0.06)
