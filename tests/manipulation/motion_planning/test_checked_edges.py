from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges, dense_points

ZERO, HALF, ONE = np.zeros(1), np.full(1, 0.5), np.ones(1)


@pytest.fixture
def asked() -> list[float]:
    return []


@pytest.fixture
def edges(asked) -> CheckedEdges:
    return CheckedEdges(lambda q: asked.append(float(q[0])) or True, 0.1, 0.02)


def test_an_edge_is_asked_everywhere_and_in_the_middle_first(edges, asked):
    assert edges.is_free(ZERO, ONE)
    assert asked[2] == 0.5
    assert np.max(np.diff(sorted(asked))) <= 0.1 + 1e-9
    assert not CheckedEdges(lambda q: not 0.34 < q[0] < 0.46, 0.1, 0.02).is_free(ZERO, ONE)


def test_no_point_is_asked_twice(edges, asked):
    assert edges.is_free(ZERO, ONE)
    assert edges.is_free(ZERO, ONE)
    assert edges.is_free(ZERO, ONE, fine=True)
    assert edges.is_free(ZERO, ONE, fine=True)
    assert len(asked) == len(set(asked))
    assert np.max(np.diff(sorted(asked))) <= 0.02 + 1e-9


def test_a_blocked_edge_is_remembered():
    questions = []
    edges = CheckedEdges(lambda q: questions.append(q) or q[0] < 0.4, 0.1, 0.02)
    assert not edges.is_free(ZERO, ONE)
    count = len(questions)
    assert not edges.is_free(ZERO, ONE, fine=True)
    assert len(questions) == count


def test_parts_of_a_known_edge_are_known_as_well_as_the_whole(edges, asked):
    edges.is_free(ZERO, ONE)
    edges.split(ZERO, ONE, HALF)
    before = len(asked)
    assert edges.is_free(ZERO, HALF)
    assert len(asked) == before
    assert edges.is_free(ZERO, HALF, fine=True)
    assert len(asked) > before
    edges.is_free(ZERO, ONE, fine=True)
    edges.split(ZERO, ONE, HALF)
    before = len(asked)
    assert edges.is_free(HALF, ONE, fine=True)
    assert len(asked) == before


def test_dense_points_hold_all_waypoints_and_leave_no_gap():
    path = np.array([[0.0, 0.0], [0.35, 0.0], [0.35, 0.0], [0.35, 1.0]])
    points = np.array(list(dense_points(path, 0.1)))
    assert np.max(np.linalg.norm(np.diff(points, axis=0), axis=1)) <= 0.1 + 1e-9
    for waypoint in path:
        assert np.min(np.linalg.norm(points - waypoint, axis=1)) < 1e-12


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_an_edge_that_is_blocked_at_one_end_is_blocked(end):
    edges = CheckedEdges(lambda q: q[0] != end, 0.1, 0.02)
    assert not edges.is_free(ZERO, ONE)
    assert not edges.is_free(ONE, ZERO, fine=True)


@pytest.mark.parametrize("place", np.linspace(0.011, 0.989, 9))
def test_a_gap_between_coarse_points_is_found_finely_wherever_it_is(place):
    edges = CheckedEdges(lambda q: abs(q[0] - place) > 0.0101, 0.1, 0.02)
    assert not edges.is_path_free(np.array([ZERO, ONE]))
    uneven = CheckedEdges(lambda q: abs(q[0] - place) > 0.0205, 0.1, 0.04)
    assert not uneven.is_free(ZERO, ONE, fine=True)


def test_a_coarsely_known_edge_is_not_finely_known_nor_are_its_parts():
    thin = CheckedEdges(lambda q: not 0.31 < q[0] < 0.35, 0.1, 0.02)
    assert thin.is_free(ZERO, ONE)
    thin.split(ZERO, ONE, HALF)
    assert thin.is_free(ZERO, HALF)
    assert not thin.is_free(ZERO, HALF, fine=True)
    assert not thin.is_free(ZERO, ONE, fine=True)
    assert thin.is_free(HALF, ONE, fine=True)


def test_a_part_of_a_coarse_edge_is_asked_at_all_its_points_when_it_has_to_be_fine(edges, asked):
    """A part begins between the points of the whole: none of its own but the end that it shares is known."""
    edges.is_free(ZERO, ONE)
    point = np.full(1, 0.53)
    edges.split(ZERO, ONE, point)
    asked.clear()
    assert edges.is_free(ZERO, point, fine=True)
    assert np.max(np.diff(sorted(asked))) <= 0.02 + 1e-9
    assert min(asked) <= 0.02
    assert 0.0 not in asked
    assert max(asked) == pytest.approx(0.53)


def test_what_is_known_finely_stays_so_when_a_coarser_edge_is_split_there(edges, asked):
    edges.is_free(ZERO, HALF, fine=True)
    edges.is_free(ZERO, ONE)
    edges.split(ZERO, ONE, HALF)
    asked.clear()
    assert edges.is_free(ZERO, HALF, fine=True)
    assert asked == []
