from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestman_bt.manipulation.motion_planning.edge import dense_points, is_edge_valid
from bestman_bt.manipulation.motion_planning.shortcut import shortcut


def outside_disc(q: np.ndarray) -> bool:
    return bool(np.linalg.norm(q) > 1.0)


def edge_free(a: np.ndarray, b: np.ndarray) -> bool:
    return is_edge_valid(a, b, outside_disc, 0.02)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_shortened_path_is_valid_never_longer_and_keeps_its_ends(seed):
    rng = np.random.default_rng(seed)
    angles = np.linspace(0.0, np.pi, 20)
    path = (1.3 + rng.uniform(0, 1, (20, 1))) * np.column_stack([np.cos(angles), np.sin(angles)])
    short = shortcut(path, edge_free, rng, 60, 20)

    def length(points):
        return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()

    assert np.array_equal(short[[0, -1]], path[[0, -1]])
    assert length(short) <= length(path) + 1e-9
    assert all(np.linalg.norm(q) > 0.99 for q in dense_points(short, 0.01)) or not edge_path_free(path)


def edge_path_free(path: np.ndarray) -> bool:
    return all(edge_free(a, b) for a, b in pairwise(path))


def test_an_edge_is_asked_everywhere_and_in_the_middle_first():
    asked: list[float] = []

    def record(q: np.ndarray) -> bool:
        asked.append(float(q[0]))
        return True

    assert is_edge_valid(np.zeros(1), np.ones(1), record, 0.1)
    assert asked[2] == 0.5
    assert np.max(np.diff(sorted(asked))) <= 0.1 + 1e-9
    assert not is_edge_valid(np.zeros(1), np.ones(1), lambda q: not 0.34 < q[0] < 0.46, 0.1)


def test_dense_points_hold_all_waypoints_and_leave_no_gap():
    path = np.array([[0.0, 0.0], [0.35, 0.0], [0.35, 0.0], [0.35, 1.0]])
    points = np.array(list(dense_points(path, 0.1)))
    assert np.max(np.linalg.norm(np.diff(points, axis=0), axis=1)) <= 0.1 + 1e-9
    for waypoint in path:
        assert np.min(np.linalg.norm(points - waypoint, axis=1)) < 1e-12
