"""Smoothing rounds corners and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.path_pieces import PathSmoother


def sharpest_turn(path: Path2D) -> float:
    headings = np.unwrap(np.arctan2(*np.diff(path.points, axis=0).T[::-1]))
    return float(np.abs(np.diff(headings)).max())


def test_a_corner_becomes_a_bend_beside_it() -> None:
    path = Path2D(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), Pose2D(1.0, 1.0, 0.0))
    smoothed = PathSmoother().smooth(path)
    assert sharpest_turn(path) == pytest.approx(np.pi / 2)
    assert sharpest_turn(smoothed) < 0.5
    away = np.linalg.norm(smoothed.points - (1.0, 0.0), axis=1).min()
    assert 0.02 < away < 0.1
    assert smoothed.points[[0, -1]].tolist() == path.points[[0, -1]].tolist()
    assert smoothed.goal == path.goal


def test_a_straight_path_stays_where_it_is() -> None:
    path = Path2D(np.array([[0.0, 0.0], [0.7, 0.0], [2.0, 0.0]]), Pose2D(2.0, 0.0, 0.0))
    assert np.abs(PathSmoother().smooth(path).points[:, 1]).max() == 0.0


def test_where_the_driving_direction_changes_the_cusp_stays() -> None:
    reverse = np.array([True, False, False])
    path = Path2D(np.array([[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), Pose2D(1.0, 1.0, 0.0), reverse)
    smoothed = PathSmoother().smooth(path)
    cusp = int(np.argmin(smoothed.reverse))
    assert smoothed.points[cusp].tolist() == [-1.0, 0.0]
    assert smoothed.reverse[:cusp].all()
    assert not smoothed.reverse[cusp:].any()
