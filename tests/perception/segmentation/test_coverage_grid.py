"""Room on a surface, told from a grid of cells on a turned plane; and how far footprints overlap."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.segmentation.horizontal_plane import footprint, overlaps
from bestman_bt.perception.segmentation.surface_coverage import ABSENT, FREE, OCCUPIED, UNSEEN, SurfaceCoverage

PLANE = Pose.from_xyz_rpy((1.0, 2.0, 0.7), (0.0, 0.0, 1.2)) @ Pose.from_xyz_rpy((0, 0, 0), (0.03, -0.02, 0.0))


def coverage(cells: np.ndarray) -> SurfaceCoverage:
    """Cells of 10 mm; the grid's corner is at (-0.3, -0.2) of the plane."""
    return SurfaceCoverage(PLANE, cells.astype(np.uint8), np.array([-0.3, -0.2]), 0.01)


def place(x: float, y: float) -> np.ndarray:
    """In the frame, 10 cm above the plane: only where it is counts."""
    on_plane = PLANE.apply(np.array([[x, y, 0.0]]))[0]
    return on_plane + np.array([0.0, 0.0, 0.1])


def half_free() -> np.ndarray:
    """60 columns along x, 40 rows along y: free for x < 0, taken beyond; no surface for y > 0.1."""
    cells = np.full((40, 60), FREE)
    cells[:, 30:] = OCCUPIED
    cells[30:] = ABSENT
    return cells


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (-0.15, -0.05, {FREE: 1.0}),
        (0.15, -0.05, {OCCUPIED: 1.0}),
        (0.0, -0.05, {FREE: 0.5, OCCUPIED: 0.5}),
        (-0.15, 0.1, {FREE: 0.5, ABSENT: 0.5}),
        (-0.3, -0.05, {FREE: 0.5, UNSEEN: 0.5}),
        (1.0, 1.0, {UNSEEN: 1.0}),
    ],
)
def test_a_disc_is_sorted_by_its_cells_and_beyond_the_grid_is_unseen(x: float, y: float, expected: dict) -> None:
    shares = coverage(half_free()).disc(place(x, y), 0.05)
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.03)
    for state in (FREE, OCCUPIED, ABSENT, UNSEEN):
        assert shares[state] == pytest.approx(expected.get(state, 0.0), abs=0.06)


def test_free_discs_lie_on_free_cells_as_a_whole_the_nearest_first() -> None:
    near = place(0.2, 0.0)
    centres = coverage(half_free()).free_discs(0.05, near)
    local = PLANE.inverse().apply(centres)
    assert local[:, 2] == pytest.approx(0.0, abs=1e-9)
    assert -0.3 + 0.05 - 0.006 <= local[:, 0].min() <= -0.3 + 0.065
    assert -0.065 <= local[:, 0].max() <= -0.05 + 0.006
    assert 0.1 - 0.065 <= local[:, 1].max() <= 0.1 - 0.05 + 0.006
    assert -0.2 + 0.05 - 0.006 <= local[:, 1].min() <= -0.2 + 0.065
    distances = np.linalg.norm(centres[:, :2] - near[:2], axis=1)
    assert np.all(np.diff(distances) >= 0.0)
    assert coverage(half_free()).free_discs(0.2, near).shape == (0, 3)


def square(x: float, size: float) -> np.ndarray:
    return np.array([[x, 0.0], [x + size, 0.0], [x + size, size], [x, size], [x + size / 2, size / 2]])


def test_footprints_overlap_by_a_share_of_the_smaller_one() -> None:
    shares = overlaps([footprint(square(x, size)) for x, size in ((0.0, 0.1), (0.08, 0.04), (0.5, 0.1))])
    assert shares == pytest.approx(np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]))


def test_a_grown_footprint_reaches_farther_on_all_sides() -> None:
    outline = footprint(square(0.0, 0.1), 0.01)[:, 0] / 1000.0
    assert outline.min(axis=0) == pytest.approx([-0.01, -0.01])
    assert outline.max(axis=0) == pytest.approx([0.11, 0.11])
    diagonal = outline @ np.array([1.0, 1.0]) / math.sqrt(2.0)
    assert diagonal.max() == pytest.approx(0.1 * math.sqrt(2.0) + 0.01)
