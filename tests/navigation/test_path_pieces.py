"""Cutting and joining planar paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.path_pieces import before_goal, joined, metres_along, nearest_along, piece

CORNER = Path2D(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]), Pose2D(2.0, 1.0, 0.3))
BACK_AND_ON = Path2D(np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 2.0]]), Pose2D(0.0, 2.0, 0.0), np.array([True, False]))


def test_metres_are_counted_along_the_corners() -> None:
    assert metres_along(CORNER).tolist() == [0.0, 2.0, 3.0]


@pytest.mark.parametrize(("position", "along"), [((0.5, 0.2), 0.5), ((2.2, 0.4), 2.4), ((-1, 0), 0.0), ((3, 3), 3.0)])
def test_the_nearest_place_lies_on_a_segment_or_at_an_end(position, along) -> None:
    assert nearest_along(CORNER, np.array(position)) == pytest.approx(along)


def test_of_a_place_that_is_passed_twice_the_one_that_is_looked_at_counts() -> None:
    there_and_back = Path2D(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 0.1]]), Pose2D())
    here = np.array([0.5, 0.05])
    assert nearest_along(there_and_back, here, 0.0, 1.0) == pytest.approx(0.5, abs=0.01)
    assert nearest_along(there_and_back, here, 4.0, math.inf) == pytest.approx(5.5, abs=0.01)


def test_a_piece_up_to_the_end_keeps_the_goal_and_another_ends_in_the_direction_of_travel() -> None:
    rest = piece(CORNER, 1.0, math.inf)
    assert rest.points.tolist() == [[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]]
    assert rest.goal == CORNER.goal
    middle = piece(CORNER, 0.5, 2.5)
    assert middle.points.tolist() == [[0.5, 0.0], [2.0, 0.0], [2.0, 0.5]]
    assert middle.goal.theta == pytest.approx(math.pi / 2)


def test_what_is_driven_backwards_stays_so_in_a_piece() -> None:
    backwards = piece(BACK_AND_ON, 0.25, 0.75)
    assert backwards.reverse.tolist() == [True]
    assert backwards.goal.theta == pytest.approx(0.0)
    assert piece(BACK_AND_ON, 0.5, 2.0).reverse.tolist() == [True, False]


def test_cut_before_its_goal_a_path_ends_at_that_distance_and_faces_the_goal() -> None:
    cut = before_goal(CORNER, 1.25)
    assert np.linalg.norm(cut.points[-1] - CORNER.points[-1]) == pytest.approx(1.25)
    assert cut.points[-1].tolist() == pytest.approx([1.25, 0.0])
    assert cut.goal.theta == pytest.approx(math.atan2(1.0, 0.75))
    assert before_goal(CORNER, 9.0).length == 0.0


def test_joined_paths_pass_where_they_meet_once() -> None:
    first, second = piece(CORNER, 0.0, 1.0), piece(CORNER, 1.0, math.inf)
    whole = joined([first, second])
    assert len(whole.points) == 4
    assert whole.length == pytest.approx(CORNER.length)
    assert whole.goal == CORNER.goal


def test_only_places_within_the_bounds_are_looked_at() -> None:
    for begin, end, position, along in (
        (0.5, 1.0, (0.1, 0.0), 0.5),
        (0.5, 1.0, (1.9, 0.0), 1.0),
        (2.2, 2.6, (2.0, 0.9), 2.6),
        (0.0, 1.0, (2.0, 0.9), 1.0),
    ):
        assert nearest_along(CORNER, np.array(position), begin, end) == pytest.approx(along)


def test_a_piece_that_would_end_before_it_begins_is_a_place() -> None:
    nothing = piece(CORNER, 2.5, 1.0)
    assert nothing.length == 0.0
    assert nothing.points[0].tolist() == [1.0, 0.0]
    assert piece(CORNER, -3.0, 0.5).points.tolist() == [[0.0, 0.0], [0.5, 0.0]]
    assert piece(CORNER, 2.0, 2.5).points.tolist() == [[2.0, 0.0], [2.0, 0.5]]


def test_a_path_that_passes_by_its_goal_is_cut_where_it_comes_near_for_the_last_time() -> None:
    by = Path2D(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 0.5]]), Pose2D(2.0, 0.5, 0.0))
    cut = before_goal(by, 1.0)
    assert np.linalg.norm(cut.points[-1] - [2.0, 0.5]) == pytest.approx(1.0)
    assert cut.length == pytest.approx(by.length - 1.0)


def test_cut_before_its_goal_a_path_that_is_driven_backwards_ends_with_its_back_to_the_goal() -> None:
    back = Path2D(np.array([[0.0, 0.0], [-2.0, 0.0]]), Pose2D(-2.0, 0.0, 0.0), np.array([True]))
    cut = before_goal(back, 0.5)
    assert cut.points[-1].tolist() == pytest.approx([-1.5, 0.0])
    assert cut.goal.theta == pytest.approx(0.0)
    assert cut.reverse.all()
