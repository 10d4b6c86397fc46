"""Point-to-plane steps for an object that stands on a plane: x, y and yaw, for many poses at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.pose_estimation.model_surface import ModelSurface, model_surface


def into_model(points: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform points (N, 3) into the model frames of S poses (x, y, yaw), metres and radians; returns (S, N, 3)."""
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    dx, dy = points[:, 0] - poses[:, 0:1], points[:, 1] - poses[:, 1:2]
    return np.stack([c * dx + s * dy, c * dy - s * dx, np.broadcast_to(points[:, 2], dx.shape)], axis=2)


def evenly(n: int, limit: int) -> NDArray[np.intp]:
    """Return the indices of at most ``limit`` of ``n`` items, evenly spaced."""
    return np.arange(n) if n <= limit else np.linspace(0, n - 1, limit).astype(np.intp)


def nearest_offsets(
    tree: cKDTree, samples: NDArray[np.float64], normals: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the offsets from the nearest sample to each point, and the normals of these samples: (N, 3) each."""
    nearest = tree.query(points)[1]
    return points - samples[nearest], normals[nearest]


def residual_rows(
    offsets: NDArray[np.float64], normals: NDArray[np.float64], points: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return residuals (M,), directions (M, 3) and points (M, 3): distances to faces and, beyond a face's end, to the
    end.

    The distances to ends constrain a box sideways if the camera sees only its front and top.
    """
    along = (offsets * normals).sum(axis=1)
    sideways = offsets - along[:, None] * normals
    distance = np.linalg.norm(sideways, axis=1)
    beyond = distance > 0.75 * spacing
    directions = sideways[beyond] / distance[beyond, None]
    return (
        np.concatenate([along, distance[beyond] - 0.5 * spacing]),
        np.concatenate([normals, directions]),
        np.concatenate([points, points[beyond]]),
    )


def gauss_newton(
    residuals: NDArray[np.float64],
    normals: NDArray[np.float64],
    moved: NDArray[np.float64],
    poses: NDArray[np.float64],
    scale: float,
    with_yaw: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return one Gauss-Newton step for S poses: (S, 3) increments and (S, 3, 3) information (of unit noise).

    ``residuals``: (S, N) along ``normals`` (S, N, 3) at the points ``moved`` (S, N, 3) of the model frame. With m =
    R(yaw)ᵀ (q - t): ∂m/∂t = -Rᵀ and ∂m/∂yaw = (m_y, -m_x, 0).
    """
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    nx, ny = normals[..., 0], normals[..., 1]
    jacobian = np.stack(
        [
            -(c * nx - s * ny),
            -(s * nx + c * ny),
            nx * moved[..., 1] - ny * moved[..., 0] if with_yaw else np.zeros_like(nx),
        ],
        axis=2,
    )
    weights = 1.0 / (1.0 + (residuals / scale) ** 2)
    weighted = jacobian * weights[..., None]
    information = np.swapaxes(jacobian, 1, 2) @ weighted
    gradient = (weighted * residuals[..., None]).sum(axis=1)
    damping = np.diag([1e-2, 1e-2, 1e-5 if with_yaw else 1.0])
    step = -np.linalg.solve(information + damping, gradient[..., None])[..., 0]
    limit = np.array([0.02, 0.02, 0.35])
    return np.clip(step, -limit, limit), information + damping


SELF_POINTS, SELF_ITERATIONS, SELF_SCALE = 300, 8, 0.004
WALL = 0.003
"""Offset towards the camera at which the nearest sample is searched, metres, so that the visible side of a thin wall is
found.
"""


@dataclass(frozen=True, eq=False)
class YawObservability:
    """A surface compared with itself, rotated by ``angles`` (K,) radians and translated for the best agreement.

    ``shifts``: (K, 2), metres: position of the rotated object's origin. ``distances``: (K, N), metres, from each sample
    of the surface to the rotated one. ``largest_distances`` are 0 on the body of a mug, which looks the same at every
    yaw, and large on its handle.
    """

    surface: ModelSurface
    angles: NDArray[np.float64]
    shifts: NDArray[np.float64]
    distances: NDArray[np.float64]

    @property
    def largest_distances(self) -> NDArray[np.float64]:
        """Return for each sample (N,) its largest distance over all rotations, metres."""
        largest: NDArray[np.float64] = self.distances.max(axis=0)
        return largest

    def shift(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the shifts (n, 2), metres, of the rotations that are nearest to ``angle`` (n,), radians."""
        return self.shifts[self.nearest_angle(angle)]

    def nearest_angle(self, angle: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the indices of the nearest ``angles``."""
        count = len(self.angles)
        return np.rint(angle / (2 * math.pi / count)).astype(np.intp) % count


def yaw_observability(surface: ModelSurface, count: int = 72) -> YawObservability:
    """Compare ``surface`` with itself at ``count`` evenly spaced turns."""
    angles = np.asarray(np.arange(count) * (2 * math.pi / count), dtype=np.float64)
    some = surface.points[evenly(len(surface.points), SELF_POINTS)]
    # A turn about the middle of the surface, or about the origin: the better one is the start.
    starts = np.concatenate([_turn_about(centre, angles) for centre in (np.median(some[:, :2], axis=0), np.zeros(2))])
    poses = slide(surface, some, starts, SELF_ITERATIONS, SELF_SCALE)
    costs = np.minimum(surface_distances(surface, some, poses), 0.02).mean(axis=1).reshape(2, count)
    poses = poses.reshape(2, count, 3)[costs.argmin(axis=0), np.arange(count)]
    return YawObservability(surface, angles, poses[:, :2], surface_distances(surface, surface.points, poses))


@cache
def model_yaw_observability(model: ObjectModel, spacing: float = 0.003) -> YawObservability:
    """Compare a standing model's surface, sampled every ``spacing`` metres, with itself at all turns."""
    return yaw_observability(model_surface(model, Pose(), spacing))


def slide(
    surface: ModelSurface,
    points: NDArray[np.float64],
    poses: NDArray[np.float64],
    iterations: int,
    scale: float,
    eye: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Fit x and y of the poses (S, 3) to ``points`` (N, 3), all in the plane's frame; the yaws are unchanged.

    ``eye``: (3,), the position of the camera: only the side of a thin wall that faces it is matched.
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
    """Return the distances (S, N), metres, from ``points`` (N, 3) to the surface at the poses (S, 3), along its
    normal.
    """
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
