"""Pictures of the stages of navigation: map, costmap, path, driven trajectory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.navigation_measures.exploration import Exploration
from benchmarks.navigation_measures.grid_pictures import draw_base, draw_costmap, draw_grid, known_box, show_known
from benchmarks.navigation_measures.map_quality import rigid_alignment, true_places
from bestman_bt.messages import OccupancyGrid
from bestman_bt.navigation.slam.base import Slam

BESIDE_PICTURE = 0.12
"""Share of a picture's width that titles and axes take from its height."""


def draw_way(axes: Axes, run: Exploration, slam: Slam) -> None:
    """Keyframes, the true way, loop closures, and what truly stands there."""
    trajectory = slam.trajectory
    true = np.array([place.xy for place in true_places(run, slam)])
    aligned = rigid_alignment(true, trajectory.poses[:, :2])
    ends = aligned.apply(run.surfaces.segments.reshape(-1, 2)).reshape(-1, 2, 2)
    axes.plot(ends[:, :, 0].T, ends[:, :, 1].T, color="orange", lw=0.7, zorder=2)
    for first, second in trajectory.loops.tolist():
        pair = trajectory.poses[[first, second], :2]
        axes.plot(pair[:, 0], pair[:, 1], color="red", lw=0.4, alpha=0.4, zorder=3)
    axes.plot(*trajectory.poses[:, :2].T, "o-", color="royalblue", ms=2.4, lw=1.6, zorder=4, label="believed")
    axes.plot(*aligned.apply(true).T, "--", color="limegreen", lw=0.9, zorder=5, label="true")
    axes.plot([], [], color="red", lw=0.8, label="loop closures")
    axes.plot([], [], color="orange", lw=0.8, label="what truly stands there")


def map_picture(run: Exploration, slam: Slam, path: Path, title: str) -> None:
    """The map with the way on it."""
    figure = Figure(figsize=(8.0, 8.0 * (_shape(slam.grid) + BESIDE_PICTURE)), dpi=110, layout="constrained")
    axes = figure.subplots()
    draw_grid(axes, slam.grid)
    draw_way(axes, run, slam)
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    _save(figure, path)


def stages_picture(run: Exploration, path: Path) -> None:
    """Map, costmap, a planned path on it, and all that was driven, beside each other."""
    grid = run.slam.grid
    costmap, longest = max(run.plans, key=lambda plan: plan[1].length)
    figure = Figure(figsize=(10.0, 10.0 * (_shape(grid) + BESIDE_PICTURE)), dpi=100, layout="constrained")
    (first, second), (third, fourth) = figure.subplots(2, 2)
    draw_grid(first, grid)
    first.set_title("the map at the end", fontsize=9)
    shown = draw_costmap(second, run.plans[-1][0])
    second.set_title("costmap, late: metres to what is there or unknown", fontsize=9)
    figure.colorbar(shown, ax=second, shrink=0.7, location="right")
    draw_costmap(third, costmap)
    third.set_title(f"costmap on the way: the longest path planned, {longest.length:.1f} m", fontsize=9)
    third.plot(*longest.points.T, color="royalblue", lw=2.0, zorder=5)
    third.plot(*longest.points[0], "o", color="royalblue", ms=7, zorder=6)
    draw_base(third, costmap.footprint, longest.goal, "limegreen")
    draw_grid(fourth, grid)
    draw_way(fourth, run, run.slam)
    fourth.set_title("driven", fontsize=9)
    for axes in (first, second, third, fourth):
        show_known(axes, grid)
        axes.set_xticks([])
        axes.set_yticks([])
    figure.legend(*fourth.get_legend_handles_labels(), loc="outside lower right", ncols=4, fontsize=8, frameon=False)
    _save(figure, path)


def _shape(grid: OccupancyGrid) -> float:
    """Height of what is known over its width."""
    low, high = known_box(grid)
    width, height = (high - low).tolist()
    return float(height / width)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure)
    figure.savefig(path)
