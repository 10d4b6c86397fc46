from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges, dense_points
from bestman_bt.manipulation.motion_planning.sampling_planner import shortcut


def outside_disc(q: np.ndarray) -> bool:
    return bool(np.linalg.norm(q) > 1.0)


def length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def half_circle(radii: np.ndarray) -> np.ndarray:
    angles = np.linspace(0.0, np.pi, len(radii))
    return radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_shortened_path_is_finely_free_never_longer_and_keeps_its_ends(seed):
    rng = np.random.default_rng(seed)
    path = half_circle(1.3 + rng.uniform(0, 1, 20))
    short = shortcut(path, CheckedEdges(outside_disc, 0.05, 0.01), rng, 60, 20)
    unbroken = all(outside_disc(q) for a, b in pairwise(path) for q in dense_points(np.array([a, b]), 0.005))
    if short is None:
        assert not unbroken
        return
    assert np.array_equal(short[[0, -1]], path[[0, -1]])
    assert length(short) <= length(path) + 1e-9
    # Between points 0.01 apart on either side of the disc's edge a chord is at most 0.0000125 inside.
    assert all(np.linalg.norm(q) > 1.0 - 1e-4 for q in dense_points(short, 0.001))


def test_shortcuts_that_only_a_coarse_check_lets_pass_are_undone(rng):
    """A thin wall that no coarse check sees, with a long way around it."""

    def is_valid(q: np.ndarray) -> bool:
        return not (0.30 < q[0] < 0.32 and q[1] < 1.0)

    around = np.array([[0.0, 0.0], [0.0, 1.2], [0.62, 1.2], [0.62, 0.0]])
    short = shortcut(around, CheckedEdges(is_valid, 0.25, 0.01), rng, 40, 20)
    assert short is not None
    assert all(is_valid(q) for q in dense_points(short, 0.01))
    assert length(short) < length(around)


def test_a_path_that_is_itself_blocked_is_no_path(rng):
    edges = CheckedEdges(lambda q: not 0.501 < q[0] < 0.520, 0.5, 0.01)
    assert shortcut(np.array([[0.0], [1.0]]), edges, rng, 10, 5) is None
