"""Frontier exploration (B. Yamauchi 1997): where the known free floor ends, and from where to look beyond.

A place to look from is worth what would be seen of the unknown from there, discounted by the way to it
(H. González-Baños, J.-C. Latombe, "Navigation strategies for exploring indoor environments", 2002).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from bestman_bt.messages import OccupancyGrid, Pose2D
from bestman_bt.messages.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from bestman_bt.navigation.global_planning import Costmap

NEIGHBOURS = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True)
class FrontierExplorerParameters:
    """Lengths in metres.

    ``min_length`` of a frontier. Places to look from lie on a lattice of ``spacing``, within ``near`` of a frontier,
    where the base can turn with ``clearance`` to spare. ``range``: how far is looked, by ``rays``. ``min_gain``: m² of
    unknown floor that a view must promise, ``closest``: how far away it is at least, for what can be seen from here has
    been seen. ``discount``: per metre of way, the share by which a view loses its worth. ``straight``: the end of the
    way that tells the heading of a view.
    """

    min_length: float = 0.30
    spacing: float = 0.35
    near: float = 1.8
    clearance: float = 0.03
    range: float = 5.0
    rays: int = 90
    min_gain: float = 0.25
    closest: float = 0.40
    discount: float = 0.25
    straight: float = 0.5


@dataclass(frozen=True, eq=False)
class Frontier:
    """A connected border between free and unknown cells: ``points`` (N, 2) metres, the centres of its free cells."""

    points: NDArray[np.float64]
    length: float


@dataclass(frozen=True)
class FrontierView:
    """Where to look from. ``gain``: m² of unknown floor in view from there. ``distance``: metres of way to it."""

    pose: Pose2D
    gain: float
    distance: float
    utility: float


def find_frontiers(grid: OccupancyGrid, min_length: float) -> list[Frontier]:
    """All frontiers of at least ``min_length`` metres, in the order of the grid's rows."""
    unknown = grid.data == UNKNOWN
    border = (grid.data == FREE) & ndimage.binary_dilation(unknown, NEIGHBOURS)
    labels, count = ndimage.label(border, NEIGHBOURS)
    frontiers = []
    for box, number in zip(ndimage.find_objects(labels), range(1, count + 1), strict=True):
        cells = np.argwhere(labels[box] == number) + np.array([box[0].start, box[1].start])
        length = len(cells) * grid.resolution
        if length >= min_length:
            frontiers.append(Frontier(grid.to_points(cells), length))
    return frontiers


class FrontierExplorer:
    """Ranks places to look from; deterministic."""

    def __init__(self, parameters: FrontierExplorerParameters | None = None) -> None:
        self._parameters = parameters or FrontierExplorerParameters()

    @property
    def parameters(self) -> FrontierExplorerParameters:
        """As given."""
        return self._parameters

    def rank(self, grid: OccupancyGrid, costmap: Costmap, pose: Pose2D) -> list[FrontierView]:
        """Places that the base can reach from ``pose``, the most useful first; none if all that can be seen is known.

        ``costmap``: of the same grid, unknown cells as obstacles.
        """
        p = self._parameters
        frontiers = find_frontiers(grid, p.min_length)
        if not frontiers:
            return []
        places = self._places(costmap)
        away, _ = cKDTree(np.concatenate([frontier.points for frontier in frontiers])).query(places)
        places = places[away < p.near]
        distances, headings = self._ways(costmap, pose, places)
        blocked = _blocked(grid)
        views = []
        for (x, y), distance, heading in zip(places.tolist(), distances.tolist(), headings.tolist(), strict=True):
            if p.closest <= distance < math.inf:
                gain = self._gain(grid, blocked, np.array([x, y]))
                if gain >= p.min_gain:
                    utility = gain * math.exp(-p.discount * distance)
                    views.append(FrontierView(Pose2D(x, y, heading), gain, distance, utility))
        return sorted(views, key=lambda view: (-view.utility, view.pose.x, view.pose.y))

    def gain(self, grid: OccupancyGrid, point: NDArray[np.float64]) -> float:
        """Square metres of unknown floor in view from a point (2,): up to the first occupied cell of each ray."""
        return self._gain(grid, _blocked(grid), point)

    def _gain(self, grid: OccupancyGrid, blocked: NDArray[np.bool_], point: NDArray[np.float64]) -> float:
        p, step = self._parameters, grid.resolution
        angles = np.arange(p.rays) * (2.0 * math.pi / p.rays)
        along = np.arange(step, p.range, step)
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        cells = grid.to_cells(np.asarray(point) + along[None, :, None] * directions[:, None])
        inside = grid.contains(cells)
        rows, columns = np.where(inside[..., None], cells, 0).transpose(2, 0, 1)
        in_view = np.logical_and.accumulate(inside & ~blocked[rows, columns], axis=1)
        seen = in_view & (grid.data[rows, columns] == UNKNOWN)
        return float((seen * along).sum() * step * 2.0 * math.pi / p.rays)

    def _places(self, costmap: Costmap) -> NDArray[np.float64]:
        """(N, 2) lattice points where the base can turn."""
        p = self._parameters
        rows, columns = costmap.distance.shape
        x_min, y_min = costmap.origin
        # Multiples of the spacing in the map frame: the lattice stays where it is when the grid grows.
        x = np.arange(math.ceil(x_min / p.spacing), math.floor((x_min + columns * costmap.resolution) / p.spacing) + 1)
        y = np.arange(math.ceil(y_min / p.spacing), math.floor((y_min + rows * costmap.resolution) / p.spacing) + 1)
        lattice: NDArray[np.float64] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) * p.spacing
        return lattice[costmap.distance_at(lattice) > costmap.footprint.circumscribed_radius + p.clearance]

    def _ways(
        self, costmap: Costmap, pose: Pose2D, places: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N,) metres of the shortest way to each place, infinite without one, and the heading at its end, radians."""
        nowhere = np.full(len(places), np.inf), np.zeros(len(places))
        free = costmap.distance > costmap.footprint.inscribed_radius
        if len(places) == 0 or not free.any():
            return nowhere
        centres = costmap.grid_points(np.argwhere(free))
        tree = cKDTree(centres)
        away, start = tree.query(pose.xy)
        if away > 2.0 * costmap.footprint.circumscribed_radius:  # close to something, a base stands beside free cells
            return nowhere
        away, cells = tree.query(places)
        lengths, before = dijkstra(_neighbours(free, costmap.resolution), False, int(start), return_predecessors=True)
        distances = np.where(away < 2.0 * costmap.resolution, lengths[cells], np.inf)
        # A base that arrives along the way need not turn once more.
        behind = cells
        for _ in range(round(self._parameters.straight / costmap.resolution)):
            behind = np.where(before[behind] >= 0, before[behind], behind)
        along = centres[cells] - centres[behind]
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


def _blocked(grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Where a view ends: at occupied cells, and unknown ones beside them, for beams meet far walls here and there."""
    blocked: NDArray[np.bool_] = ndimage.binary_dilation(grid.data == OCCUPIED, NEIGHBOURS) & (grid.data != FREE)
    return blocked
