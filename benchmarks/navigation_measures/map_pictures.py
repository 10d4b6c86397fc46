"""Pictures of the stages of navigation: map, costmap, path, driven trajectory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.navigation_measures.exploration import Exploration
from benchmarks.navigation_measures.map_quality import rigid_alignment, true_places
from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.occupancy_grid import FREE, OCCUPIED
from bestman_bt.navigation.slam import Slam


def draw_grid(axes: Axes, grid: OccupancyGrid) -> None:
    """Black walls, white floor, grey where nothing is known."""
    shade = np.select([grid.data == OCCUPIED, grid.data == FREE], [0.0, 1.0], 0.8)
    axes.imshow(shade, cmap="gray", vmin=0, vmax=1, extent=_extent(grid), origin="lower", interpolation="nearest")
    axes.set_aspect("equal")


def draw_way(axes: Axes, run: Exploration, slam: Slam) -> None:
    """Keyframes (blue), the true way (green, dashed), loop closures (red), what truly stands there (orange)."""
    trajectory = slam.trajectory
    true = np.array([place.xy for place in true_places(run, slam)])
    aligned = rigid_alignment(true, trajectory.poses[:, :2])
    ends = aligned.apply(run.surfaces.segments.reshape(-1, 2)).reshape(-1, 2, 2)
    axes.plot(ends[:, :, 0].T, ends[:, :, 1].T, color="orange", lw=0.6, zorder=2)
    for first, second in trajectory.loops.tolist():
        pair = trajectory.poses[[first, second], :2]
        axes.plot(pair[:, 0], pair[:, 1], color="red", lw=0.5, alpha=0.6, zorder=3)
    axes.plot(*trajectory.poses[:, :2].T, "o-", color="royalblue", ms=2.2, lw=0.9, zorder=4)
    axes.plot(*aligned.apply(true).T, "--", color="limegreen", lw=0.9, zorder=5)


def map_picture(run: Exploration, slam: Slam, path: Path, title: str) -> None:
    """The map with the way on it."""
    rows, columns = slam.grid.data.shape
    figure = Figure(figsize=(8.0, 8.0 * rows / columns), dpi=110, layout="constrained")
    axes = figure.subplots()
    draw_grid(axes, slam.grid)
    draw_way(axes, run, slam)
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    _save(figure, path)


def stages_picture(run: Exploration, path: Path) -> None:
    """Map, costmap, a planned path on it, and all that was driven, beside each other."""
    grid = run.slam.grid
    costmap, longest = max(run.plans, key=lambda plan: plan[1].length)
    rows, columns = grid.data.shape
    figure = Figure(figsize=(10.0, 10.6 * rows / columns), dpi=100, layout="constrained")
    (first, second), (third, fourth) = figure.subplots(2, 2)
    draw_grid(first, grid)
    first.set_title("map: log odds of the scans", fontsize=9)
    distance = np.clip(costmap.distance, 0.0, 1.0)
    for axes, title in ((second, "costmap: metres to what is in the way"), (third, "the longest path planned on it")):
        shown = axes.imshow(distance, extent=_extent(costmap.grid), origin="lower", cmap="magma")
        axes.set_title(title, fontsize=9)
    figure.colorbar(shown, ax=second, shrink=0.7)
    third.plot(*longest.points.T, color="cyan", lw=1.6)
    third.plot(*longest.points[-1], "*", color="cyan", ms=9)
    draw_grid(fourth, grid)
    draw_way(fourth, run, run.slam)
    fourth.set_title("driven: believed (blue), true (green), loop closures (red)", fontsize=9)
    for axes in (first, second, third, fourth):
        axes.set_axis_off()
    _save(figure, path)


def _extent(grid: OccupancyGrid) -> tuple[float, float, float, float]:
    rows, columns = grid.data.shape
    x, y = grid.origin.tolist()
    return x, x + columns * grid.resolution, y, y + rows * grid.resolution


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure)
    figure.savefig(path)
