"""Ways over the free floor, from one place to many at once (E. Dijkstra 1959)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from bestman_bt.navigation.global_planning import Costmap


class FreeFloor:
    """The cells of a costmap where the middle of the base can be without touching anything."""

    def __init__(self, costmap: Costmap) -> None:
        free = costmap.distance > costmap.footprint.inscribed_radius
        self._resolution, self._beside = costmap.resolution, 2.0 * costmap.footprint.circumscribed_radius
        self._centres = costmap.grid_points(np.argwhere(free))
        self._tree = cKDTree(self._centres)
        self._graph = _neighbours(free, costmap.resolution)

    def ways(
        self, start: NDArray[np.float64], places: NDArray[np.float64], straight: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N,) metres of the shortest way from ``start`` (2,) to each of ``places`` (N, 2), and (N,) its last heading.

        Infinite where there is none. The heading, radians, is that of the last ``straight`` metres.
        """
        nowhere = np.full(len(places), np.inf), np.zeros(len(places))
        if len(places) == 0 or len(self._centres) == 0:
            return nowhere
        away, first = self._tree.query(start)
        if away > self._beside:  # close to something, a base stands beside free cells
            return nowhere
        away, cells = self._tree.query(places)
        lengths, before = dijkstra(self._graph, False, int(first), return_predecessors=True)
        distances = np.where(away < 2.0 * self._resolution, lengths[cells], np.inf)
        behind = cells
        for _ in range(round(straight / self._resolution)):
            behind = np.where(before[behind] < 0, behind, before[behind])
        along = self._centres[cells] - self._centres[behind]
        return distances, np.arctan2(along[:, 1], along[:, 0])


def _neighbours(free: NDArray[np.bool_], resolution: float) -> sparse.csr_matrix:
    """Distances between free cells that touch, in the order of the free cells; half of a symmetric matrix."""
    number = np.full(free.shape, -1, dtype=np.intp)
    number[free] = np.arange(int(free.sum()))
    first, second, length = [], [], []
    for rows, columns in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = number[: free.shape[0] - rows, max(0, -columns) : free.shape[1] - max(0, columns)]
        there = number[rows:, max(0, columns) : free.shape[1] + min(0, columns)]
        joined = (here >= 0) & (there >= 0)
        first.append(here[joined])
        second.append(there[joined])
        length.append(np.full(int(joined.sum()), resolution * math.hypot(rows, columns)))
    entries = (np.concatenate(length), (np.concatenate(first), np.concatenate(second)))
    return sparse.coo_matrix(entries, shape=(int(free.sum()),) * 2).tocsr()
