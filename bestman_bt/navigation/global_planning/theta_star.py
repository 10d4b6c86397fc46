"""Theta*: any-angle paths on the grid, in the lazy form of Nash, Koenig and Tovey (AAAI 2010), with cost.

A cell is connected straight to an ancestor if that is cheaper than by its neighbour; one line of sight is checked per
expanded cell. As in nav2's planner, lines accumulate the cost of the cells that they cross.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestman_bt.navigation.global_planning.grid_search import Cell, cheapest_path, search_in_corridor
from bestman_bt.navigation.global_planning.polyline_planner import FreeSpace, PolylinePlanner


@dataclass(frozen=True)
class ThetaStar(PolylinePlanner):
    """Lazy Theta* on the costmap; deterministic."""

    def search_path(
        self, start: NDArray[np.float64], goal: NDArray[np.float64], room: FreeSpace
    ) -> NDArray[np.float64] | None:
        """Return the points (N, 2) of the cheapest any-angle path, metres, or None."""
        lethal = room.lethal_distance, room.lethal_slack
        vertices = search_in_corridor(theta_cells, start, goal, room.field, *lethal)
        if vertices is None or not room.turns_everywhere:
            return vertices
        # Lines of sight are looked at cell by cell; where that was too coarse, the way over the cells is taken.
        pieces = [vertices[:1]]
        costs = room.segment_costs(vertices[:-1], vertices[1:])
        for (begin, end), cost in zip(pairwise(vertices), costs, strict=True):
            cells = None if math.isfinite(cost) else cheapest_path(begin, end, room.field, *lethal)
            pieces += [end[None]] if cells is None else [cells]
        return np.vstack(pieces)


def theta_cells(cost: NDArray[np.float64], source: Cell, target: Cell) -> NDArray[np.intp] | None:
    """Return the cells at which a cheap any-angle path turns, as a ``grid_search.Search``."""
    width = cost.shape[1]
    costs: list[float] = cost.ravel().tolist()  # plain lists are faster than arrays here
    diagonal = math.sqrt(2.0)
    moves = [(1, 1.0), (-1, 1.0), (width, 1.0), (-width, 1.0)]
    moves += [(d, diagonal) for d in (width + 1, width - 1, 1 - width, -1 - width)]
    rows_off = np.arange(cost.shape[0])[:, None] - target[0]
    columns_off = np.arange(width)[None, :] - target[1]
    estimate: list[float] = np.hypot(rows_off, columns_off).ravel().tolist()
    first, last = source[0] * width + source[1], target[0] * width + target[1]
    infinite = math.inf
    reached = [infinite] * len(costs)
    parent = [-1] * len(costs)
    closed = bytearray(len(costs))
    reached[first], parent[first] = 0.0, first
    queue = [(estimate[first], first)]
    while queue:
        _, cell = heapq.heappop(queue)
        if closed[cell]:
            continue
        closed[cell] = 1
        ancestor = parent[parent[cell]]
        straight = reached[ancestor] + _line_cost(costs, width, ancestor, cell)
        if straight <= reached[cell]:
            reached[cell], parent[cell] = straight, ancestor
        if cell == last:
            break
        so_far, here = reached[cell], costs[cell]
        for offset, length in moves:
            neighbour = cell + offset
            there = costs[neighbour]
            if there == infinite or closed[neighbour]:
                continue
            total = so_far + length * 0.5 * (here + there)
            if total < reached[neighbour]:
                reached[neighbour] = total
                parent[neighbour] = cell
                heapq.heappush(queue, (total + estimate[neighbour], neighbour))
    if not closed[last]:
        return None
    way = [last]
    while way[-1] != first:
        way.append(parent[way[-1]])
    cells = np.array(way[::-1])
    return np.column_stack([cells // width, cells % width])


def _line_cost(costs: list[float], width: int, begin: int, end: int) -> float:
    """Return the cost of the straight line between two cells, by the cells of Bresenham's algorithm."""
    row, column = divmod(begin, width)
    rows, columns = end // width - row, end % width - column
    steps = max(abs(rows), abs(columns))
    if steps == 0:
        return 0.0
    total = 0.5 * (costs[begin] + costs[end])
    along, across, offset = (rows, columns, width) if abs(rows) >= abs(columns) else (columns, rows, 1)
    sideways = 1 if offset == width else width
    forward = offset if along > 0 else -offset
    slope = across / steps
    for step in range(1, steps):
        total += costs[begin + step * forward + math.floor(step * slope + 0.5) * sideways]
    return total / steps * math.hypot(rows, columns)
