"""Shortening a joint path: random shortcuts between any two of its points, checked lazily.

Geraerts and Overmars, "Creating high-quality paths for motion planning", IJRR 2007. A shortcut is accepted after a
coarse check; only what is left in the end is checked finely, and undone where that fails.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges

_LEAST_GAIN = 0.01
"""Radians; less is not worth the checks."""


def shortcut(
    path: NDArray[np.float64], edges: CheckedEdges, rng: np.random.Generator, attempts: int, patience: int
) -> NDArray[np.float64] | None:
    """Return a path (M, n) with the ends of ``path`` (N, n), never longer, all of whose edges are finely checked.

    First waypoints are skipped where the way past them is free, then ``attempts`` random pairs of points are joined;
    ``patience``: attempts without success after which it ends. None if not even ``path`` stands the fine check.
    """
    shortened = _last_free(path, _shorter(path, edges, rng, attempts, patience, fine=False), edges)
    if shortened is None:
        return None
    free, undone = shortened
    if undone:
        for better in _shorter(free, edges, rng, attempts, patience, fine=True):
            free = better
    # Parts of finely checked edges are finely known; an edge that is not would be a mistake here, so it is asked.
    return free if edges.is_path_free(free) else None


def _last_free(
    path: NDArray[np.float64], versions: Iterator[NDArray[np.float64]], edges: CheckedEdges
) -> tuple[NDArray[np.float64], bool] | None:
    """The latest version that stands the fine check, and whether later ones were dropped."""
    history = [path, *versions]
    for version in reversed(history):
        if edges.is_path_free(version):
            return version, version is not history[-1]
    return None


def _shorter(
    path: NDArray[np.float64], edges: CheckedEdges, rng: np.random.Generator, attempts: int, patience: int, fine: bool
) -> Iterator[NDArray[np.float64]]:
    """Shorter and shorter versions of ``path``."""
    for skipped in _skip_waypoints(path, edges, fine):
        path = skipped
        yield path
    failures = 0
    for _ in range(attempts):
        if len(path) < 3 or failures >= patience:
            break
        marks = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        first, last = np.sort(rng.uniform(0.0, marks[-1], 2))
        i, a = _point_at(path, marks, first)
        j, b = _point_at(path, marks, last)
        gain = last - first - np.linalg.norm(b - a)
        if i == j or gain < _LEAST_GAIN:
            failures += 1
            continue
        if not edges.is_free(a, b, fine):
            failures += 1
            continue
        edges.split(path[i], path[i + 1], a)
        edges.split(path[j], path[j + 1], b)
        path = _without_repeats(np.concatenate([path[: i + 1], [a, b], path[j + 1 :]]))
        failures = 0
        yield path
    yield from _skip_waypoints(path, edges, fine)


def _skip_waypoints(path: NDArray[np.float64], edges: CheckedEdges, fine: bool) -> Iterator[NDArray[np.float64]]:
    i = 0
    while i + 2 < len(path):
        if edges.is_free(path[i], path[i + 2], fine):
            path = np.delete(path, i + 1, axis=0)
            yield path
            i = max(0, i - 1)
        else:
            i += 1


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
