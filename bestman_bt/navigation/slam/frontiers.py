"""Frontier exploration (B. Yamauchi 1997): borders of the known free floor, and views beyond them.

A view is worth the unknown area that it would show, discounted by the path to it (H. González-Baños, J.-C. Latombe,
"Navigation strategies for exploring indoor environments", 2002). The views that together show everything are visited on
the shortest tour, so that no corner is left for the way back (M. Kulich, J. Faigl, L. Přeučil, "On distance utility in
the exploration task", 2011).
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from typing_extensions import override

from bestman_bt.messages import OccupancyGrid, Pose2D
from bestman_bt.messages.grids import FREE, OCCUPIED, UNKNOWN
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, Positive
from bestman_bt.navigation.global_planning.costmap import Costmap


class FreeFloor:
    """The cells of a costmap where the middle of the base is free, with shortest paths between them (E. Dijkstra,
    1959)."""

    def __init__(self, costmap: Costmap) -> None:
        free = costmap.distance > costmap.footprint.inscribed_radius
        self._resolution, self._beside = costmap.resolution, 2.0 * costmap.footprint.circumscribed_radius
        self._centres = costmap.grid_points(np.argwhere(free))
        self._tree = cKDTree(self._centres)
        self._graph = _neighbours(free, costmap.resolution)

    def ways(
        self, start: NDArray[np.float64], places: NDArray[np.float64], straight: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the length (N,), metres, of the shortest path from ``start`` (2,) to each of ``places`` (N, 2), and
        its last heading (N,).

        Infinite without a path. The heading, radians, is that of the last ``straight`` metres.
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
    """Return the distances between adjacent free cells, in the order of the free cells; half of a symmetric matrix."""
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


def shortest_tour(distances: NDArray[np.float64]) -> list[int]:
    """Return the order of the shortest open tour of the places of ``distances`` (N, N) from place 0.

    M. Held, R. Karp, "A dynamic programming approach", 1962. The effort grows with 2**N: suitable for a dozen places.
    Unreachable places come last.
    """
    count = len(distances)
    if count < 2:
        return []
    # Ways that do not exist count as very long ones, so that the others are still ordered.
    table = np.where(np.isfinite(distances), distances, 1e6).tolist()
    best: dict[tuple[int, int], tuple[float, int]] = {
        (1 << place, place): (table[0][place], 0) for place in range(1, count)
    }
    for size in range(2, count):
        for visited in itertools.combinations(range(1, count), size):
            bits = sum(1 << place for place in visited)
            for last in visited:
                rest = bits ^ (1 << last)
                best[bits, last] = min(
                    (best[rest, place][0] + table[place][last], place) for place in visited if place != last
                )
    bits = (1 << count) - 2
    last = min(range(1, count), key=lambda place: best[bits, place])
    order = []
    while last:
        order.append(last)
        bits, last = bits ^ (1 << last), best[bits, last][1]
    return order[::-1]


NEIGHBOURS = np.ones((3, 3), dtype=bool)
BLOCK = 5
"""Cells along each side of a block that counts as seen as a whole, since distant rays leave gaps."""


@dataclass(frozen=True, eq=False)
class Frontier:
    """A connected border between free and unknown cells: ``points`` (N, 2) metres, the centres of its free cells."""

    points: NDArray[np.float64]
    length: float


@dataclass(frozen=True)
class FrontierView:
    """A candidate view. ``distance``: metres of the path to it.

    ``gain``: m² of unknown floor visible from there, without the part that better views of the same tour show.
    """

    pose: Pose2D
    gain: float
    distance: float
    utility: float


def find_frontiers(grid: OccupancyGrid, min_length: float) -> list[Frontier]:
    """Return all frontiers of at least ``min_length`` metres, in the order of the grid's rows."""
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


class ExplorationPlanner(ABC):
    """Chooses the next views of an unknown place."""

    @abstractmethod
    def tour(
        self, grid: OccupancyGrid, costmap: Costmap, pose: Pose2D, useless: NDArray[np.float64] | None = None
    ) -> list[FrontierView]:
        """Return the reachable views from ``pose``, in the order of the tour; empty if everything is known.

        ``costmap``: of the same grid, unknown cells as obstacles. ``useless``: (N, 2) places tried in vain.
        """

    @abstractmethod
    def is_useful(self, grid: OccupancyGrid, point: NDArray[np.float64]) -> bool:
        """Return whether a view from a point (2,) would still show enough unknown floor to drive there."""


@dataclass(frozen=True)
class FrontierExplorer(ExplorationPlanner):
    """Chooses the views that together show everything, on the shortest tour; deterministic.

    Lengths in metres. ``min_length``: of a frontier. Views lie on a lattice of ``spacing``, within ``near`` of a
    frontier, where the base can turn with ``clearance`` to spare. ``range``: of the view, with ``rays``, and ``depth``:
    assumed depth of visible unknown space per ray. ``min_gain``: m² of unknown floor that a view must promise,
    ``closest``: its smallest distance, because nearby space has been seen. ``discount``: loss of worth per metre of
    path. ``stops``: views of a tour. ``again``: distance to a useless view within which others are skipped.
    ``straight``: length of the path's end that defines the heading.
    """

    min_length: Annotated[NonNegative, "m"] = 0.30
    spacing: Annotated[Positive, "m"] = 0.35
    near: Annotated[Positive, "m"] = 1.8
    clearance: Annotated[NonNegative, "m"] = 0.03
    range: Annotated[Positive, "m"] = 5.0
    rays: Count = 120
    depth: Annotated[Positive, "m"] = 2.0
    min_gain: Annotated[NonNegative, "m²"] = 0.4
    closest: Annotated[NonNegative, "m"] = 0.40
    discount: Annotated[Fraction, "1/m"] = 0.25
    stops: Count = 8
    again: Annotated[NonNegative, "m"] = 0.3
    straight: Annotated[NonNegative, "m"] = 0.5

    @override
    def tour(
        self, grid: OccupancyGrid, costmap: Costmap, pose: Pose2D, useless: NDArray[np.float64] | None = None
    ) -> list[FrontierView]:
        frontiers = find_frontiers(grid, self.min_length)
        if not frontiers:
            return []
        places = self._places(costmap)
        away, _ = cKDTree(np.concatenate([frontier.points for frontier in frontiers])).query(places)
        near = away < self.near
        if useless is not None and len(useless):
            near &= cKDTree(useless).query(places)[0] > self.again
        places = places[near]
        floor = FreeFloor(costmap)
        distances, headings = floor.ways(pose.xy, places, self.straight)
        blocked = _blocked(grid)
        candidates = []
        for (x, y), distance, heading in zip(places.tolist(), distances.tolist(), headings.tolist(), strict=True):
            if self.closest <= distance < math.inf:
                seen, areas = self._seen(grid, blocked, np.array([x, y]))
                if areas.sum() >= self.min_gain:
                    candidates.append(_Candidate(Pose2D(x, y, heading), distance, seen, areas))
        stops = self._stops(candidates, grid.data.size)
        points = np.array([pose.xy, *(stop.pose.xy for stop in stops)])
        between = np.array([floor.ways(point, points, self.straight)[0] for point in points])
        return [stops[number - 1] for number in shortest_tour(between)]

    @override
    def is_useful(self, grid: OccupancyGrid, point: NDArray[np.float64]) -> bool:
        return self.gain(grid, point) >= self.min_gain

    def gain(self, grid: OccupancyGrid, point: NDArray[np.float64]) -> float:
        """Return the area of unknown floor, m², visible from a point (2,): up to the first occupied cell of each
        ray.
        """
        return float(self._seen(grid, _blocked(grid), point)[1].sum())

    def _seen(
        self, grid: OccupancyGrid, blocked: NDArray[np.bool_], point: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return the numbers of the blocks of unknown floor that may be in view from a point, and the counted m² of
        each.
        """
        step = grid.resolution
        angles = np.arange(self.rays) * (2.0 * math.pi / self.rays)
        along = np.arange(step, self.range, step)
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        cells = grid.to_cells(np.asarray(point) + along[None, :, None] * directions[:, None])
        inside = grid.contains(cells)
        rows, columns = np.where(inside[..., None], cells, 0).transpose(2, 0, 1)
        in_view = np.logical_and.accumulate(inside & ~blocked[rows, columns], axis=1)
        seen = in_view & (grid.data[rows, columns] == UNKNOWN)
        blocks = rows // BLOCK * grid.data.shape[1] + columns // BLOCK
        numbers, of = np.unique(blocks[seen], return_inverse=True)
        counted = np.cumsum(seen, axis=1) * step <= self.depth
        areas = (along * counted)[seen] * step * 2.0 * math.pi / self.rays
        return numbers, np.bincount(of, areas, minlength=len(numbers)).astype(float)

    def _stops(self, candidates: list[_Candidate], cells: int) -> list[FrontierView]:
        """Return the most useful view, then the most useful one of what that leaves unseen, and so on."""
        unseen = np.ones(cells, dtype=bool)
        stops: list[FrontierView] = []
        while len(stops) < self.stops:
            gains = [float((candidate.areas * unseen[candidate.seen]).sum()) for candidate in candidates]
            utilities = [
                gain * math.exp(-self.discount * candidate.distance) if gain >= self.min_gain else 0.0
                for gain, candidate in zip(gains, candidates, strict=True)
            ]
            best = int(np.argmax(utilities)) if utilities else 0
            if not utilities or utilities[best] == 0.0:
                break
            chosen = candidates[best]
            unseen[chosen.seen] = False
            stops.append(FrontierView(chosen.pose, gains[best], chosen.distance, utilities[best]))
        return stops

    def _places(self, costmap: Costmap) -> NDArray[np.float64]:
        """Return (N, 2) lattice points where the base can turn."""
        rows, columns = costmap.distance.shape
        x_min, y_min = costmap.origin
        x_max, y_max = x_min + columns * costmap.resolution, y_min + rows * costmap.resolution
        # Multiples of the spacing in the map frame: the lattice stays where it is when the grid grows.
        x = np.arange(math.ceil(x_min / self.spacing), math.floor(x_max / self.spacing) + 1)
        y = np.arange(math.ceil(y_min / self.spacing), math.floor(y_max / self.spacing) + 1)
        lattice: NDArray[np.float64] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) * self.spacing
        return lattice[costmap.distance_at(lattice) > costmap.footprint.circumscribed_radius + self.clearance]


@dataclass(frozen=True, eq=False)
class _Candidate:
    """``seen``: numbers of blocks of unknown floor that may be in view, ``areas``: m² of each that count."""

    pose: Pose2D
    distance: float
    seen: NDArray[np.intp]
    areas: NDArray[np.float64]


def _blocked(grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Return where a view ends: at occupied cells, and at unknown ones beside them, since beams are sparse on far
    walls.
    """
    blocked: NDArray[np.bool_] = ndimage.binary_dilation(grid.data == OCCUPIED, NEIGHBOURS) & (grid.data != FREE)
    return blocked
