"""Draws the pictures of docs/localisation.md: where a scan might have been taken, and particles on the map.

Run it with ``python benchmarks/localisation_pictures.py FOLDER [--seed S]``; rays stand in for the lidar.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.localization.base import OdometryScan
from bestman_bt.navigation.localization.correlative_search import CorrelativeSearch, DistanceField
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.semantic_map import SemanticMap
from examples.plugins.particle_filter import ParticleFilter

BEAMS, RANGE = 360, 8.0


def scan_at(pose: Pose2D, segments: np.ndarray, rng: np.random.Generator) -> LaserScan:
    """With 2 cm of noise, from the middle of the base."""
    angles = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)
    ranges, _ = cast_rays(segments, pose, angles)
    ranges = ranges + rng.normal(0.0, 0.02, BEAMS)
    return LaserScan(np.where(ranges < RANGE, ranges, np.inf), -math.pi, 2 * math.pi / BEAMS, 0.1, RANGE, 0.0)


def draw_map(axes: Axes, known: SemanticMap, title: str) -> None:
    segments = known.lidar_segments().reshape(-1, 2, 2)
    axes.add_collection(LineCollection(list(segments), colors="0.25", linewidths=1.2))
    for piece in known.furniture.values():
        axes.fill(*piece.corners().T, color="0.85", zorder=0)
    axes.set_aspect("equal")
    axes.autoscale()
    axes.set_axis_off()
    axes.set_title(title, fontsize=9)


def arrow(axes: Axes, pose: Pose2D, color: str, size: float = 0.5) -> None:
    axes.quiver(
        pose.x, pose.y, size * math.cos(pose.theta), size * math.sin(pose.theta), color=color, angles="xy",
        scale_units="xy", scale=1.0, width=0.008, zorder=5,
    )  # fmt: skip


def draw_search(known: SemanticMap, truth: Pose2D, file: Path) -> None:
    """The scan, and the places that it might be from, as it is laid on the map at the likeliest."""
    scan = scan_at(truth, known.lidar_segments(), np.random.default_rng(1))
    places = CorrelativeSearch().locate(known, [OdometryScan(Pose2D(), scan)], Pose2D())
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_map(left, known, f"{len(places)} places explain half of the scan or more")
    for place in places[1:]:
        arrow(left, place.pose, "tab:orange")
    arrow(left, places[0].pose, "tab:red")
    draw_map(right, known, f"the scan at the likeliest: probability {places[0].probability:.3f}")
    right.plot(*places[0].pose.apply(scan.points()).T, ".", color="tab:red", markersize=2)
    arrow(right, places[0].pose, "tab:red")
    save(figure, file)


def draw_particles(known: SemanticMap, truth: Pose2D, file: Path) -> None:
    """From all over the floor to one place, while the base turns and drives."""
    rng, localizer, odometry = np.random.default_rng(2), ParticleFilter(known), Pose2D()
    estimate = localizer.start(Pose2D(), odometry, 1.0, math.pi)
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    panels = dict(zip((0, 1, 20, 60), figure.subplots(1, 4), strict=True))
    for scans in range(61):
        if scans:
            truth, odometry = truth @ Pose2D(0.03, 0.0, 0.05), odometry @ Pose2D(0.033, 0.0, 0.055)
            estimate = localizer.predict(estimate, odometry)
            estimate = localizer.correct(estimate, scan_at(truth, known.lidar_segments(), rng), Pose2D())
        if scans in panels:
            axes, particles = panels[scans], estimate.particles
            draw_map(axes, known, f"scans taken: {scans}, particles: {len(particles)}")
            axes.plot(*particles[:, :2].T, ".", color="tab:blue", markersize=1.5, alpha=0.4)
            arrow(axes, truth, "tab:green")
    save(figure, file)


def save(figure: Figure, file: Path) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(file, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=3)
    arguments = parser.parse_args()
    known = semantic_map(draw_world(load_scene("apartment"), arguments.seed))
    floor = DistanceField.of_map(known, clearance=0.5)
    x, y, theta = floor.draw(1, np.random.default_rng(arguments.seed))[0].tolist()
    draw_search(known, Pose2D(x, y, theta), arguments.folder / "localisation_search.png")
    draw_particles(known, Pose2D(x, y, theta), arguments.folder / "localisation_particles.png")


if __name__ == "__main__":
    main()
