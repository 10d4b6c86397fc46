from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.navigation.global_planning.footprint import Footprint

BASE = Footprint(np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]), 0.01)


def block(low, high):
    """Corners of an upright box, (8, 3)."""
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def test_what_rides_within_the_outline_is_no_overhang():
    carried = BASE.carrying([block((-0.3, -0.2, 0.3), (0.3, 0.2, 1.5))], 0.01)
    assert carried.overhang is None
    assert carried.above is carried


def test_the_outline_above_is_the_hull_of_the_base_and_of_what_stands_out_with_its_sway():
    above = BASE.carrying(
        [block((0.0, 0.1, 0.9), (0.1, 0.3, 1.2)), block((0.0, 0.0, 0.1), (0.1, 0.1, 1.5))], 0.01
    ).above
    assert above.corners.min(axis=0) == pytest.approx([-0.3, -0.2], abs=1e-6)
    assert above.corners[:, 0].max() == pytest.approx(0.3, abs=1e-6)
    assert 0.31 <= above.corners[:, 1].max() < 0.312
    assert above.turning_drift == BASE.turning_drift


def test_an_overhang_reports_how_far_and_from_which_height_on_it_stands_out():
    overhang = BASE.carrying(
        [block((0.0, 0.1, 0.9), (0.1, 0.3, 1.2)), block((0.2, 0.0, 1.0), (0.42, 0.1, 1.3))], 0.01
    ).overhang
    assert overhang.reach == pytest.approx(0.12)
    assert overhang.height == pytest.approx(0.89)
    assert str(overhang) == "the arm extends 12 cm beyond the base, 0.89 m above the floor"


def test_of_a_body_that_leans_out_the_height_counts_at_which_it_leaves_the_outline():
    leaning = np.array([[0.1, 0.0, 0.4], [0.5, 0.0, 1.2], [0.5, 0.01, 1.2], [0.1, 0.01, 0.4]])
    assert BASE.carrying([leaning], 0.0).overhang.height == pytest.approx(0.8, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_all_points_of_the_bodies_lie_within_the_outline_above_and_none_that_stands_out_lies_below_its_height(seed):
    rng = np.random.default_rng(seed)
    bodies = [rng.uniform((-0.5, -0.5, 0.3), (0.5, 0.5, 1.5), (12, 3)) for _ in range(3)]
    carried = BASE.carrying(bodies, 0.01)
    weights = rng.dirichlet(np.full(12, 0.4), 4000)
    points = np.concatenate([weights @ body for body in bodies])
    assert beyond(carried.above, points).max() < 0.0
    out = points[beyond(BASE, points) > 0.0]
    assert carried.overhang.height - 0.001 <= out[:, 2].min() - 0.01
    assert carried.overhang.height > min(body[:, 2].min() for body in bodies) - 0.011


def beyond(footprint, points):
    """Metres (N,) that points (N, 3) lie beyond the nearest side of an outline; negative within."""
    edges = np.roll(footprint.corners, -1, axis=0) - footprint.corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    return (points[:, :2] @ normals.T - np.einsum("ij,ij->i", normals, footprint.corners)).max(axis=1)


def test_a_wheel_that_is_as_wide_as_the_base_is_no_overhang_for_a_rounding_error():
    turn = np.linspace(0.0, 2 * math.pi, 16, endpoint=False)
    wheel = np.column_stack([0.1 * np.cos(turn), np.full(16, 0.2005), 0.1 + 0.1 * np.sin(turn)])
    assert BASE.carrying([wheel], 0.01).overhang is None
