"""How a model's surface changes when the object turns: what a view must show to tell its yaw."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.pose_estimation.model_surface import ModelSurface
from bestman_bt.perception.pose_estimation.point_to_plane import evenly, gauss_newton, into_model

SELF_POINTS, SELF_ITERATIONS, SELF_SCALE = 300, 8, 0.004
WALL = 0.003
"""Metres towards the camera at which the nearest sample is sought: of thin walls the side that was seen."""


@dataclass(frozen=True, eq=False)
class TurnedSurface:
    """A surface compared with itself, turned by ``angles`` (K,) radians and moved where the two agree best.

    ``shifts``: (K, 2), metres: where the turned object's origin comes to lie. ``distances``: (K, N), metres, from each
    sample of the surface to the turned one. ``telling``: (N,), the largest distance over all turns: 0 on the body of a
    mug, which looks the same at every yaw, and large on its handle.
    """

    surface: ModelSurface
    angles: NDArray[np.float64]
    shifts: NDArray[np.float64]
    distances: NDArray[np.float64]

    @property
    def telling(self) -> NDArray[np.float64]:
        """See the class."""
        largest: NDArray[np.float64] = self.distances.max(axis=0)
        return largest

    def shift(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """The shifts (n, 2) of the turns nearest to ``angle`` (n,) radians."""
        return self.shifts[self.nearest_turn(angle)]

    def nearest_turn(self, angle: NDArray[np.float64]) -> NDArray[np.intp]:
        """Indices among ``angles``."""
        count = len(self.angles)
        return np.rint(angle / (2 * math.pi / count)).astype(np.intp) % count


def turned_surface(surface: ModelSurface, count: int = 72) -> TurnedSurface:
    """Compare ``surface`` with itself at ``count`` evenly spaced turns."""
    angles = np.asarray(np.arange(count) * (2 * math.pi / count), dtype=np.float64)
    some = surface.points[evenly(len(surface.points), SELF_POINTS)]
    # A turn about the middle of the surface, or about the origin: the better one is the start.
    starts = np.concatenate([_turn_about(centre, angles) for centre in (np.median(some[:, :2], axis=0), np.zeros(2))])
    poses = slide(surface, some, starts, SELF_ITERATIONS, SELF_SCALE)
    costs = np.minimum(surface_distances(surface, some, poses), 0.02).mean(axis=1).reshape(2, count)
    poses = poses.reshape(2, count, 3)[costs.argmin(axis=0), np.arange(count)]
    return TurnedSurface(surface, angles, poses[:, :2], surface_distances(surface, surface.points, poses))


def slide(
    surface: ModelSurface,
    points: NDArray[np.float64],
    poses: NDArray[np.float64],
    iterations: int,
    scale: float,
    eye: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Fit x and y of the poses (S, 3) to ``points`` (N, 3), all in the plane's frame; the yaws stay.

    ``eye``: (3,), where the camera stood: of a thin wall its side is matched.
    """
    for _ in range(iterations):
        moved, nearest = _match(surface, points, poses, eye)
        normals = surface.normals[nearest]
        residuals = ((moved - surface.points[nearest]) * normals).sum(axis=2)
        step, _ = gauss_newton(residuals, normals, moved, poses, scale, with_yaw=False)
        poses = poses + step
    return poses


def surface_distances(
    surface: ModelSurface,
    points: NDArray[np.float64],
    poses: NDArray[np.float64],
    eye: NDArray[np.float64] | None = None,
    spacing: float = 0.003,
) -> NDArray[np.float64]:
    """Metres (S, N) from ``points`` (N, 3) to the surface at the poses (S, 3): along its normal where it goes on."""
    moved, nearest = _match(surface, points, poses, eye)
    offsets = moved - surface.points[nearest]
    along = (offsets * surface.normals[nearest]).sum(axis=2)
    sideways = np.sqrt(np.maximum(0.0, (offsets**2).sum(axis=2) - along**2))
    # Between samples the surface goes on; beyond the last one it ends.
    distances: NDArray[np.float64] = np.hypot(along, np.maximum(0.0, sideways - 2 * spacing))
    return distances


def _match(
    surface: ModelSurface,
    points: NDArray[np.float64],
    poses: NDArray[np.float64],
    eye: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    moved = into_model(points, poses)
    if eye is None:
        return moved, surface.nearest_samples(moved)
    towards = eye - points
    nearer = points + WALL * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    return moved, surface.nearest_samples(into_model(nearer, poses))


def _turn_about(centre: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    c, s = np.cos(angles), np.sin(angles)
    x = centre[0] - c * centre[0] + s * centre[1]
    y = centre[1] - s * centre[0] - c * centre[1]
    return np.stack([x, y, angles], axis=1)
