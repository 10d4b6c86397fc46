"""Search of cheapest paths over the cells of a costmap, 8-connected; a step costs its length times the mean of both
cells.

The result is that of A* (Hart, Nilsson and Raphael 1968), but without a heuristic: SciPy's Dijkstra in C takes a
quarter of the time of A* in Python. On large grids a search over coarse cells first finds a corridor for the search
over the cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from bestman_bt.navigation.global_planning.costmap import Costmap

LARGE = 30_000
"""Number of cells from which a corridor is searched first."""
COARSE = 4
"""Number of cells along each side of a coarse cell: walls with the clearance of a base are wider than two cells."""
CORRIDOR = 1
"""Number of coarse cells on each side of the coarse path that belong to the corridor."""

Cell = tuple[int, int]
Search = Callable[[NDArray[np.float64], Cell, Cell], NDArray[np.intp] | None]
"""A search function: from costs per metre (rows, columns), infinite where lethal and along the border, and two cells,
to the cells (N, 2) of a path, rows and columns; None if there is none.
"""


def cheapest_path(
    start: NDArray[np.float64], goal: NDArray[np.float64], costmap: Costmap, lethal_distance: float, slack: float = 0.0
) -> NDArray[np.float64] | None:
    """Return the centres (N, 2) of the cells on the cheapest path, metres, or None.

    ``slack``: metres by which cells may be nearer to an obstacle than ``lethal_distance``, at the highest cost.
    """
    return search_in_corridor(cheapest_cells, start, goal, costmap, lethal_distance, slack)


def search_in_corridor(
    search: Search,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    costmap: Costmap,
    lethal_distance: float,
    slack: float,
) -> NDArray[np.float64] | None:
    """Return the path (N, 2), metres, that ``search`` finds between two points; on large grids in a corridor if
    possible.
    """
    padded = _padded(costmap, lethal_distance, slack)
    source, target = _nearest_free(start, padded, costmap), _nearest_free(goal, padded, costmap)
    if source is None or target is None:
        return None
    cells = None
    if costmap.distance.size > LARGE:
        corridor = _corridor(padded, source, target)
        cells = None if corridor is None else _search_within(search, padded, corridor, source, target)
    if cells is None:
        cells = search(padded, source, target)
    return None if cells is None else costmap.grid_points(cells - 1)


def cheapest_cells(cost: NDArray[np.float64], source: Cell, target: Cell) -> NDArray[np.intp] | None:
    """Return the cheapest path as cells (N, 2), row and column, or None; a ``Search``.

    ``cost``: (rows, columns), infinite in blocked cells.
    """
    graph, free, number = _graph(cost)
    first, last = (int(number[cell]) for cell in (source, target))
    reached, previous = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
    if not np.isfinite(reached[last]):
        return None
    way = [last]
    while way[-1] != first:
        way.append(int(previous[way[-1]]))
    cells = free[way[::-1]]
    return np.column_stack([cells // cost.shape[1], cells % cost.shape[1]])


def costs_to(goal: NDArray[np.float64], costmap: Costmap, lethal_distance: float) -> NDArray[np.float64]:
    """Return the cost of the cheapest path from each cell to ``goal`` (2,), (rows, columns); infinite if
    unreachable.
    """
    padded = _padded(costmap, lethal_distance, 0.0)
    costs = np.full(costmap.distance.shape, np.inf)
    target = _nearest_free(goal, padded, costmap)
    if target is not None:
        graph, free, number = _graph(padded)
        whole = np.full(padded.size, np.inf)
        whole[free] = dijkstra(graph, directed=False, indices=int(number[target]))
        costs = whole.reshape(padded.shape)[1:-1, 1:-1]
    return costs


def _padded(costmap: Costmap, lethal_distance: float, slack: float) -> NDArray[np.float64]:
    """Return the cost of the cells with a border of lethal ones, which saves every bounds check."""
    return np.pad(costmap.cost(costmap.distance, lethal_distance, slack), 1, constant_values=np.inf)


def _graph(cost: NDArray[np.float64]) -> tuple[csr_matrix, NDArray[np.intp], NDArray[np.int32]]:
    """Return the steps between free cells, their flat indices, and (rows, columns) the number of each,
    -1 where lethal.
    """
    width = cost.shape[1]
    flat = cost.ravel()
    free = np.flatnonzero(np.isfinite(flat))
    number = np.full(flat.size, -1, dtype=np.int32)
    number[free] = np.arange(len(free), dtype=np.int32)
    # Half of the eight neighbours: each step is as good the other way round.
    offsets = np.array([1, width - 1, width, width + 1])
    lengths = np.array([1.0, math.sqrt(2.0), 1.0, math.sqrt(2.0)])
    beside = free[:, None] + offsets
    neighbours = number[beside]
    exists = neighbours >= 0
    steps = (lengths * 0.5 * (flat[free][:, None] + flat[beside]))[exists]
    ends = np.concatenate([[0], np.cumsum(exists.sum(axis=1))])
    graph = csr_matrix((steps, neighbours[exists], ends), shape=(len(free), len(free)))
    return graph, free, number.reshape(cost.shape)


def areas_of_disc(costmap: Costmap, radius: float) -> NDArray[np.intp]:
    """Return for each cell (rows, columns) the number of the connected area of a disc centred on it; 0: collision."""
    labels, _ = ndimage.label(costmap.distance > radius, structure=np.ones((3, 3)))
    return np.asarray(labels, dtype=np.intp)


def shortest_length(start: NDArray[np.float64], goal: NDArray[np.float64], costmap: Costmap, radius: float) -> float:
    """Return the length of the shortest 8-connected path of a disc between two points (2,), metres; infinite without
    one.
    """
    plain = replace(costmap, rasterization=replace(costmap.rasterization, cost_weight=0.0))
    cells = cheapest_path(start, goal, plain, radius)
    if cells is None:
        return math.inf
    return float(np.linalg.norm(np.diff(np.vstack([start, cells[1:-1], goal]), axis=0), axis=1).sum())


def _corridor(padded: NDArray[np.float64], source: Cell, target: Cell) -> NDArray[np.bool_] | None:
    """Return the cells around the cheapest way over coarse cells, each as cheap as the cheapest in it, or None without
    one.
    """
    height, width = (math.ceil(size / COARSE) for size in padded.shape)
    whole = np.full((height * COARSE, width * COARSE), np.inf)
    whole[: padded.shape[0], : padded.shape[1]] = padded
    coarse = np.full((height + 2, width + 2), np.inf)
    coarse[1:-1, 1:-1] = whole.reshape(height, COARSE, width, COARSE).min(axis=(1, 3))
    ends = [(row // COARSE + 1, column // COARSE + 1) for row, column in (source, target)]
    way = cheapest_cells(coarse, ends[0], ends[1])
    if way is None:
        return None
    corridor = np.zeros(coarse.shape, dtype=bool)
    corridor[way[:, 0], way[:, 1]] = True
    corridor = ndimage.binary_dilation(corridor, np.ones((3, 3)), CORRIDOR)[1:-1, 1:-1]
    cells: NDArray[np.bool_] = corridor.repeat(COARSE, axis=0).repeat(COARSE, axis=1)
    return cells[: padded.shape[0], : padded.shape[1]]


def _search_within(
    search: Search, padded: NDArray[np.float64], corridor: NDArray[np.bool_], source: Cell, target: Cell
) -> NDArray[np.intp] | None:
    (top, bottom), (left, right) = ((int(k.min()), int(k.max())) for k in np.nonzero(corridor))
    window = np.full((bottom - top + 3, right - left + 3), np.inf)
    inside = np.s_[top : bottom + 1, left : right + 1]
    window[1:-1, 1:-1] = np.where(corridor[inside], padded[inside], np.inf)
    shift = np.array([top - 1, left - 1])
    cells = search(window, *((row - shift[0], column - shift[1]) for row, column in (source, target)))
    return None if cells is None else cells + shift


def _nearest_free(point: NDArray[np.float64], padded: NDArray[np.float64], costmap: Costmap) -> Cell | None:
    """Return row and column in the padded grid of the free cell nearest to a point, at most two cells away."""
    column, row = np.floor((point - costmap.origin) / costmap.resolution).astype(int) + 1
    best: tuple[float, Cell] | None = None
    for r in range(max(0, row - 2), min(padded.shape[0], row + 3)):
        for c in range(max(0, column - 2), min(padded.shape[1], column + 3)):
            if np.isfinite(padded[r, c]):
                away = float(np.linalg.norm(costmap.grid_points(np.array([r - 1, c - 1])) - point))
                if best is None or away < best[0]:
                    best = away, (r, c)
    return None if best is None else best[1]
