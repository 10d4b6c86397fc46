"""How maps, costmaps and bases look in the benchmarks' pictures."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from bestman_bt.messages import OccupancyGrid, Pose2D
from bestman_bt.messages.grids import FREE, OCCUPIED, UNKNOWN
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint

MARGIN = 0.3
"""Metres of the unknown that are shown around what is known."""
FAR = 0.8
"""Metres from everything from which on floor is white."""
NEARNESS = LinearSegmentedColormap.from_list("nearness", ["#f4a582", "#fddbc7", "#ffffff"])
NEARNESS.set_under("#3b3b3b")


def draw_grid(axes: Axes, grid: OccupancyGrid) -> None:
    """Black walls, white floor, grey where nothing is known; the axes show what is known."""
    shade = np.select([grid.data == OCCUPIED, grid.data == FREE], [0.0, 1.0], 0.8)
    axes.imshow(shade, cmap="gray", vmin=0, vmax=1, extent=_extent(grid), origin="lower", interpolation="nearest")
    axes.set_facecolor("0.8")
    show_known(axes, grid)


def draw_costmap(axes: Axes, costmap: Costmap) -> AxesImage:
    """Dark where something is or nothing is known, from red to white the farther away that is."""
    # Walls have no thickness: their cells are those with a centre within half a cell.
    distance = np.where(costmap.distance <= costmap.resolution / 2.0, -1.0, costmap.distance)
    extent = _extent(costmap.grid)
    axes.set_aspect("equal")
    axes.set_facecolor(NEARNESS(-1.0))
    return axes.imshow(
        distance, cmap=NEARNESS, vmin=0.0, vmax=FAR, extent=extent, origin="lower", interpolation="nearest"
    )


def draw_base(axes: Axes, footprint: Footprint, pose: Pose2D, colour: str) -> None:
    """The outline at a pose, with a line to where it faces."""
    axes.fill(*pose.apply(footprint.corners).T, facecolor=colour, edgecolor="black", lw=0.8, zorder=6)
    axes.plot(*np.array([pose.xy, pose.apply([0.35, 0.0])]).T, color="black", lw=1.2, zorder=7)


def show_known(axes: Axes, grid: OccupancyGrid) -> None:
    """Let the axes show what a grid knows, and a little around it."""
    low, high = known_box(grid)
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - MARGIN, high[0] + MARGIN)
    axes.set_ylim(low[1] - MARGIN, high[1] + MARGIN)


def known_box(grid: OccupancyGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Its corners with the smallest and with the largest x and y, metres."""
    known = np.argwhere(grid.data != UNKNOWN)
    half = grid.resolution / 2.0
    return grid.to_points(known.min(axis=0)) - half, grid.to_points(known.max(axis=0)) + half


def _extent(grid: OccupancyGrid) -> tuple[float, float, float, float]:
    rows, columns = grid.data.shape
    x, y = grid.origin.tolist()
    return x, x + columns * grid.resolution, y, y + rows * grid.resolution
