"""Shortening a joint path: random shortcuts between any two of its points.

Geraerts and Overmars, "Creating high-quality paths for motion planning", IJRR 2007.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

EdgeCheck = Callable[[NDArray[np.float64], NDArray[np.float64]], bool]


def shortcut(
    path: NDArray[np.float64],
    is_edge_free: EdgeCheck,
    rng: np.random.Generator,
    attempts: int,
    patience: int,
) -> NDArray[np.float64]:
    """Return a path (M, n) with the ends of ``path`` (N, n), never longer, whose new edges passed ``is_edge_free``.

    First waypoints are skipped where the way past them is free, then ``attempts`` random pairs of points are joined;
    ``patience``: attempts without success after which it ends.
    """
    path = _skip_waypoints(path, is_edge_free)
    failures = 0
    for _ in range(attempts):
        if len(path) < 3 or failures >= patience:
            break
        marks = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        first, last = np.sort(rng.uniform(0.0, marks[-1], 2))
        i, a = _point_at(path, marks, first)
        j, b = _point_at(path, marks, last)
        gain = last - first - np.linalg.norm(b - a)
        if i == j or gain < 1e-3 or not is_edge_free(a, b):
            failures += 1
            continue
        path = _without_repeats(np.concatenate([path[: i + 1], [a, b], path[j + 1 :]]))
        failures = 0
    return _skip_waypoints(path, is_edge_free)


def _skip_waypoints(path: NDArray[np.float64], is_edge_free: EdgeCheck) -> NDArray[np.float64]:
    points = list(path)
    i = 0
    while i + 2 < len(points):
        if is_edge_free(points[i], points[i + 2]):
            del points[i + 1]
            i = max(0, i - 1)
        else:
            i += 1
    return np.array(points)


def _point_at(path: NDArray[np.float64], marks: NDArray[np.float64], mark: float) -> tuple[int, NDArray[np.float64]]:
    """The segment that holds the point at arc length ``mark``, and the point."""
    i = min(int(np.searchsorted(marks, mark, side="right")) - 1, len(path) - 2)
    fraction = (mark - marks[i]) / max(marks[i + 1] - marks[i], 1e-12)
    return i, path[i] + fraction * (path[i + 1] - path[i])


def _without_repeats(path: NDArray[np.float64]) -> NDArray[np.float64]:
    keep = np.concatenate([[True], np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9])
    keep[-1] = True
    kept: NDArray[np.float64] = path[keep]
    return kept
