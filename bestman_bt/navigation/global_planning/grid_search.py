"""A* on the grid (Hart, Nilsson, Raphael 1968), 8-connected; a step costs its length times the mean of both cells.

On large grids a search over coarse cells first finds the corridor that the search over the cells keeps to.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bestman_bt.navigation.global_planning.costmap import Costmap

LARGE = 30_000
"""Cells from which on a corridor is sought first."""
COARSE = 4
"""Cells along each side of a coarse cell: walls with the room that a base keeps from them are wider than two."""
CORRIDOR = 1
"""Coarse cells on each side of the coarse way that belong to the corridor."""


def cheapest_way(
    start: NDArray[np.float64], goal: NDArray[np.float64], costmap: Costmap, lethal_distance: float, slack: float = 0.0
) -> NDArray[np.float64] | None:
    """Centres (N, 2) of the cells on the cheapest way, or None.

    ``slack``: metres by which cells may be nearer to an obstacle than ``lethal_distance``, at the highest cost.
    """
    rows, columns = costmap.distance.shape
    # A border of lethal cells around the grid saves every bounds check; plain lists are faster than arrays here.
    padded = np.full((rows + 2, columns + 2), np.inf)
    padded[1:-1, 1:-1] = costmap.cost(costmap.distance, lethal_distance, slack)
    source, target = _nearest_free(start, padded, costmap), _nearest_free(goal, padded, costmap)
    if source is None or target is None:
        return None
    cells = _search_in_corridor(padded, source, target) if rows * columns > LARGE else None
    if cells is None:
        cells = _search(padded, source, target)
    return None if cells is None else costmap.grid_points(cells - 1)


def areas_of_disc(costmap: Costmap, radius: float) -> NDArray[np.intp]:
    """(rows, columns) The number of the connected area that the middle of a disc is in at each cell; 0: it touches."""
    labels, _ = ndimage.label(costmap.distance > radius, structure=np.ones((3, 3)))
    return np.asarray(labels, dtype=np.intp)


def shortest_length(start: NDArray[np.float64], goal: NDArray[np.float64], costmap: Costmap, radius: float) -> float:
    """Metres of the shortest 8-connected way of a disc's middle between two points (2,); infinite without one."""
    plain = replace(costmap, parameters=replace(costmap.parameters, cost_weight=0.0))
    cells = cheapest_way(start, goal, plain, radius)
    if cells is None:
        return math.inf
    return float(np.linalg.norm(np.diff(np.vstack([start, cells[1:-1], goal]), axis=0), axis=1).sum())


def _search(padded: NDArray[np.float64], source: tuple[int, int], target: tuple[int, int]) -> NDArray[np.intp] | None:
    """Cells (N, 2), row and column in the grid, on the cheapest way; None without one. The grid's border is lethal."""
    height, width = padded.shape
    cost: list[float] = padded.ravel().tolist()
    diagonal = math.sqrt(2.0)
    moves = [(1, 1.0), (-1, 1.0), (width, 1.0), (-width, 1.0)]
    moves += [(d, diagonal) for d in (width + 1, width - 1, 1 - width, -1 - width)]
    columns_off = np.abs(np.arange(width) - target[1])[None, :]
    rows_off = np.abs(np.arange(height) - target[0])[:, None]
    octile = np.maximum(columns_off, rows_off) + (diagonal - 1.0) * np.minimum(columns_off, rows_off)
    estimate: list[float] = octile.ravel().tolist()
    first, last = source[0] * width + source[1], target[0] * width + target[1]
    infinite = math.inf
    reached = [infinite] * len(cost)
    parent = [-1] * len(cost)
    closed = bytearray(len(cost))
    reached[first] = 0.0
    queue = [(estimate[first], first)]
    while queue:
        _, cell = heapq.heappop(queue)
        if cell == last:
            break
        if closed[cell]:
            continue
        closed[cell] = 1
        so_far, here = reached[cell], cost[cell]
        for offset, length in moves:
            neighbour = cell + offset
            there = cost[neighbour]
            if there == infinite or closed[neighbour]:
                continue
            total = so_far + length * 0.5 * (here + there)
            if total < reached[neighbour]:
                reached[neighbour] = total
                parent[neighbour] = cell
                heapq.heappush(queue, (total + estimate[neighbour], neighbour))
    if reached[last] == infinite:
        return None
    way = [last]
    while way[-1] != first:
        way.append(parent[way[-1]])
    cells = np.array(way[::-1])
    return np.column_stack([cells // width, cells % width])


def _search_in_corridor(
    padded: NDArray[np.float64], source: tuple[int, int], target: tuple[int, int]
) -> NDArray[np.intp] | None:
    """As ``_search``, only around the cheapest way over coarse cells, each as cheap as the cheapest in it."""
    height, width = (math.ceil(size / COARSE) for size in padded.shape)
    whole = np.full((height * COARSE, width * COARSE), np.inf)
    whole[: padded.shape[0], : padded.shape[1]] = padded
    coarse = np.full((height + 2, width + 2), np.inf)
    coarse[1:-1, 1:-1] = whole.reshape(height, COARSE, width, COARSE).min(axis=(1, 3))
    ends = [(row // COARSE + 1, column // COARSE + 1) for row, column in (source, target)]
    way = _search(coarse, ends[0], ends[1])
    if way is None:
        return None
    corridor = np.zeros(coarse.shape, dtype=bool)
    corridor[way[:, 0], way[:, 1]] = True
    corridor = ndimage.binary_dilation(corridor, np.ones((3, 3)), CORRIDOR)[1:-1, 1:-1]
    within = corridor.repeat(COARSE, axis=0).repeat(COARSE, axis=1)[: padded.shape[0], : padded.shape[1]]
    (top, bottom), (left, right) = ((int(k.min()), int(k.max())) for k in np.nonzero(within))
    window = np.full((bottom - top + 3, right - left + 3), np.inf)
    inside = np.s_[top : bottom + 1, left : right + 1]
    window[1:-1, 1:-1] = np.where(within[inside], padded[inside], np.inf)
    shift = np.array([top - 1, left - 1])
    cells = _search(window, *((row - shift[0], column - shift[1]) for row, column in (source, target)))
    return None if cells is None else cells + shift


def _nearest_free(point: NDArray[np.float64], padded: NDArray[np.float64], costmap: Costmap) -> tuple[int, int] | None:
    """Row and column in the padded grid of the free cell nearest to a point, at most two cells away."""
    column, row = np.floor((point - costmap.origin) / costmap.resolution).astype(int) + 1
    best: tuple[float, tuple[int, int]] | None = None
    for r in range(max(0, row - 2), min(padded.shape[0], row + 3)):
        for c in range(max(0, column - 2), min(padded.shape[1], column + 3)):
            if np.isfinite(padded[r, c]):
                away = float(np.linalg.norm(costmap.grid_points(np.array([r - 1, c - 1])) - point))
                if best is None or away < best[0]:
                    best = away, (r, c)
    return None if best is None else best[1]
