"""How good a map that SLAM has made is, and the way that it believes to have been driven."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.navigation_measures.exploration import Exploration
from bestman_bt.messages import Pose2D
from bestman_bt.messages.grids import FREE, OCCUPIED
from bestman_bt.navigation.slam.base import Slam

NEAR = 0.05
"""Metres."""


@dataclass(frozen=True)
class MapQuality:
    """``ate``: root mean square metres between keyframes and truth, after the rigid alignment that makes it least
    (Sturm et al. 2012); ``from_start``: the same with the first pose alone aligned. ``cells``: share of the occupied
    cells whose centre is within 5 cm of a true surface; ``found``: share of the surfaces that the beams hit with an
    occupied cell within 5 cm; ``floor``: share of the floor that can be reached which the map has as free.
    ``loops``: closures.
    """

    ate: float
    from_start: float
    cells: float
    found: float
    floor: float
    loops: int


def true_places(run: Exploration, slam: Slam) -> list[Pose2D]:
    """Where the base truly was when the keyframes were taken."""
    by_stamp = {reading.scan.stamp: reading.true_pose for reading in run.readings}
    return [by_stamp[stamp] for stamp in slam.trajectory.stamps.tolist()]


def map_quality(run: Exploration, slam: Slam) -> MapQuality:
    """Judge what ``slam`` has made of the readings of ``run``."""
    poses, grid, places = slam.trajectory.poses, slam.grid, true_places(run, slam)
    true = np.array([place.xy for place in places])
    first = places[0] @ Pose2D(*poses[0]).inverse()
    from_start = np.linalg.norm(first.apply(poses[:, :2]) - true, axis=1)
    aligned = rigid_alignment(poses[:, :2], true)
    errors = np.linalg.norm(aligned.apply(poses[:, :2]) - true, axis=1)
    occupied = aligned.apply(grid.to_points(np.argwhere(grid.data == OCCUPIED)))
    off, _ = cKDTree(run.surfaces.points).query(occupied)
    seen = np.concatenate([r.true_pose.apply(r.base_from_lidar.apply(r.scan.points())) for r in run.readings[::5]])
    away, nearest = cKDTree(run.surfaces.points).query(seen)
    hit, count = np.unique(nearest[away < 0.03], return_counts=True)
    missed, _ = cKDTree(occupied).query(run.surfaces.points[hit[count >= 2]])
    cells = grid.to_cells(aligned.inverse().apply(run.floor))
    inside = cells[grid.contains(cells)]
    return MapQuality(
        ate=float(np.sqrt(np.mean(errors**2))),
        from_start=float(np.sqrt(np.mean(from_start**2))),
        cells=float((off < NEAR).mean()),
        found=float((missed < NEAR).mean()),
        floor=float((grid.data[tuple(inside.T)] == FREE).sum()) / len(run.floor),
        loops=len(slam.trajectory.loops),
    )


def rigid_alignment(points: NDArray[np.float64], onto: NDArray[np.float64]) -> Pose2D:
    """The pose that brings ``points`` (N, 2) nearest to ``onto`` in the mean of squares (Umeyama 1991, no scale)."""
    a, b = points - points.mean(axis=0), onto - onto.mean(axis=0)
    angle = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    shift = onto.mean(axis=0) - Pose2D(0.0, 0.0, angle).apply(points.mean(axis=0))
    return Pose2D(float(shift[0]), float(shift[1]), angle)
