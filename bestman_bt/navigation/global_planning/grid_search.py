"""A* on the grid (Hart, Nilsson, Raphael 1968), 8-connected; a step costs its length times the mean of both cells."""

from __future__ import annotations

import heapq
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bestman_bt.navigation.global_planning.costmap import Costmap


def cheapest_way(
    start: NDArray[np.float64], goal: NDArray[np.float64], costmap: Costmap, lethal_distance: float
) -> NDArray[np.float64] | None:
    """Centres (N, 2) of the cells on the cheapest way, or None."""
    rows, columns = costmap.distance.shape
    # A border of lethal cells around the grid saves every bounds check; plain lists are faster than arrays here.
    padded = np.full((rows + 2, columns + 2), np.inf)
    padded[1:-1, 1:-1] = costmap.cost(costmap.distance, lethal_distance)
    width = columns + 2
    source = _nearest_free(start, padded, costmap)
    target = _nearest_free(goal, padded, costmap)
    if source is None or target is None:
        return None
    cost: list[float] = padded.ravel().tolist()
    diagonal = math.sqrt(2.0)
    moves = [(1, 1.0), (-1, 1.0), (width, 1.0), (-width, 1.0)]
    moves += [(d, diagonal) for d in (width + 1, width - 1, 1 - width, -1 - width)]
    target_row, target_column = divmod(target, width)
    columns_off = np.abs(np.arange(width) - target_column)[None, :]
    rows_off = np.abs(np.arange(rows + 2) - target_row)[:, None]
    octile = np.maximum(columns_off, rows_off) + (diagonal - 1.0) * np.minimum(columns_off, rows_off)
    estimate: list[float] = octile.ravel().tolist()
    infinite = math.inf
    reached = [infinite] * len(cost)
    parent = [-1] * len(cost)
    closed = bytearray(len(cost))
    reached[source] = 0.0
    queue = [(estimate[source], source)]
    while queue:
        _, cell = heapq.heappop(queue)
        if cell == target:
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
    if reached[target] == infinite:
        return None
    way = [target]
    while way[-1] != source:
        way.append(parent[way[-1]])
    cells = np.array(way[::-1])
    return costmap.grid_points(np.column_stack([cells // width - 1, cells % width - 1]))


def _nearest_free(point: NDArray[np.float64], padded: NDArray[np.float64], costmap: Costmap) -> int | None:
    """Flat index in the padded grid of the free cell nearest to a point, at most two cells away."""
    column, row = np.floor((point - costmap.origin) / costmap.resolution).astype(int) + 1
    best: tuple[float, int] | None = None
    for r in range(max(0, row - 2), min(padded.shape[0], row + 3)):
        for c in range(max(0, column - 2), min(padded.shape[1], column + 3)):
            if np.isfinite(padded[r, c]):
                away = float(np.linalg.norm(costmap.grid_points(np.array([r - 1, c - 1])) - point))
                if best is None or away < best[0]:
                    best = away, r * padded.shape[1] + c
    return None if best is None else best[1]


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
