"""Point-to-plane steps for an object that stands on a plane: x, y and yaw, for many poses at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def into_model(points: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 3) in the model frames of S poses (x, y, yaw): (S, N, 3)."""
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    dx, dy = points[:, 0] - poses[:, 0:1], points[:, 1] - poses[:, 1:2]
    return np.stack([c * dx + s * dy, c * dy - s * dx, np.broadcast_to(points[:, 2], dx.shape)], axis=2)


def evenly(n: int, limit: int) -> NDArray[np.intp]:
    """Indices of at most ``limit`` out of ``n`` things, evenly spread."""
    return np.arange(n) if n <= limit else np.linspace(0, n - 1, limit).astype(np.intp)


def nearest_offsets(
    tree: cKDTree, samples: NDArray[np.float64], normals: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """From the nearest sample to each point, and the normal there: (N, 3) each."""
    nearest = tree.query(points)[1]
    return points - samples[nearest], normals[nearest]


def residual_rows(
    offsets: NDArray[np.float64], normals: NDArray[np.float64], points: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (M,), directions (M, 3), points (M, 3): distances to faces and, beyond a face's end, to the end.

    Without the second kind nothing would hold a box sideways where the camera sees only its front and top.
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
    """One step for S poses: (S, 3) increments and (S, 3, 3) information (of unit noise).

    ``residuals``: (S, N) along ``normals`` (S, N, 3) at the points ``moved`` (S, N, 3) of the model frame.
    With m = R(yaw)ᵀ (q - t): ∂m/∂t = -Rᵀ and ∂m/∂yaw = (m_y, -m_x, 0).
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
