"""The visible surface of a model as samples with normals, and a grid for fast nearest-sample lookup."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from bestman_bt.messages import Box, Cylinder, Mesh, ObjectModel, Pose, Shape, Sphere
from bestman_bt.perception.errors import PerceptionError

_DARK = 0.02
"""Added to each channel before division by the sum of rgb (chromaticity); black would give noise."""


def model_palette(model: ObjectModel) -> NDArray[np.float64]:
    """Return the colours that a model has somewhere, (K, 3) rgb, 0 to 1."""
    return np.array([model.color, *model.visual_colors])


def color_distances(colors: NDArray[np.uint8], palette: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances (N,) of the chromaticities of ``colors`` (N, 3) to the nearest in ``palette`` (K, 3), 0 to
    1.
    """
    seen = colors.astype(np.float64) / 255.0 + _DARK
    seen /= seen.sum(axis=1, keepdims=True)
    wanted = palette + _DARK
    wanted /= wanted.sum(axis=1, keepdims=True)
    distances: NDArray[np.float64] = np.linalg.norm(seen[:, None] - wanted, axis=2).min(axis=1)
    return distances


@dataclass(frozen=True, eq=False)
class ModelSurface:
    """A model at rest on a plane: z = 0 is the plane, x and y are those of the model's origin.

    ``points``, ``normals``: (n, 3) samples, metres. ``rest_from_object``: pose of the object at rest. ``nearest``: (X,
    Y, Z) index of the sample nearest to each cell of edge ``cell`` metres; ``origin``: lower corner of cell (0, 0, 0).
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    rest_from_object: Pose
    nearest: NDArray[np.int32]
    origin: NDArray[np.float64]
    cell: float

    @property
    def height(self) -> float:
        """The height of the object above the plane, metres."""
        return float(self.points[:, 2].max())

    @property
    def reach(self) -> float:
        """Largest horizontal distance between two points, metres (at most; by the bounding box)."""
        return float(np.linalg.norm(np.ptp(self.points[:, :2], axis=0)))

    def nearest_samples(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return the indices (...,) of the samples nearest to ``points`` (..., 3); approximate beyond the margin."""
        cells = ((points - self.origin) * (1.0 / self.cell)).astype(np.intp)
        np.clip(cells, 0, np.array(self.nearest.shape) - 1, out=cells)
        return self.nearest[cells[..., 0], cells[..., 1], cells[..., 2]]


def model_surface(
    model: ObjectModel, orientation: Pose, spacing: float, cell: float = 0.003, margin: float = 0.03
) -> ModelSurface:
    """Sample the model's visual shapes (else its collision shapes) about every ``spacing`` metres.

    ``orientation``: the rotation of the resting object. ``margin``: of the grid around the object, metres.
    """
    parts = [sample_shape(placed.shape, spacing) for placed in model.visual or model.collision]
    poses = [orientation @ placed.pose for placed in model.visual or model.collision]
    if not parts:
        raise PerceptionError(f"model {model.name!r} has no shapes: give it visual or collision shapes")
    points = np.concatenate([pose.apply(part[0]) for pose, part in zip(poses, parts, strict=True)])
    normals = np.concatenate([part[1] @ pose.rotation.T for pose, part in zip(poses, parts, strict=True)])
    bottom = float(points[:, 2].min())
    points[:, 2] -= bottom
    origin = points.min(axis=0) - margin
    shape = np.ceil((np.ptp(points, axis=0) + 2 * margin) / cell).astype(int) + 1
    occupied = np.full(tuple(shape), -1, dtype=np.int32)
    i, j, k = ((points - origin) / cell).astype(np.intp).T
    # Written from the last to the first: the first sample of a cell stays.
    occupied[i[::-1], j[::-1], k[::-1]] = np.arange(len(points), dtype=np.int32)[::-1]
    a, b, c = distance_transform_edt(occupied < 0, return_distances=False, return_indices=True)
    rest = Pose(np.array([0.0, 0.0, -bottom]), orientation.quaternion)
    return ModelSurface(points, normals, rest, occupied[a, b, c], origin, cell)


def sample_shape(shape: Shape, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return samples and outward normals, (n, 3) each, about ``spacing`` metres apart; deterministic."""
    match shape:
        case Box():
            return _sample_box(np.array(shape.size), spacing)
        case Cylinder():
            return _sample_cylinder(shape.radius, shape.length, spacing)
        case Sphere():
            n = max(32, math.ceil(4 * math.pi * shape.radius**2 / spacing**2))
            z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
            angle = np.arange(n) * math.pi * (3.0 - math.sqrt(5.0))
            ring = np.sqrt(1.0 - z * z)
            normals = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
            return normals * shape.radius, normals
        case Mesh():
            return _sample_mesh(shape, spacing)


def _steps(length: float, spacing: float) -> NDArray[np.float64]:
    n = max(2, math.ceil(length / spacing))
    return ((np.arange(n) + 0.5) / n - 0.5) * length


def _sample_box(size: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    points, normals = [], []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        u, v = np.meshgrid(_steps(size[first], spacing), _steps(size[second], spacing), indexing="ij")
        for sign in (-1.0, 1.0):
            face = np.zeros((u.size, 3))
            face[:, axis], face[:, first], face[:, second] = sign * size[axis] / 2, u.ravel(), v.ravel()
            normal = np.zeros((u.size, 3))
            normal[:, axis] = sign
            points.append(face)
            normals.append(normal)
    return np.concatenate(points), np.concatenate(normals)


def _sample_cylinder(radius: float, length: float, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = max(12, math.ceil(2 * math.pi * radius / spacing))
    angles, z = np.meshgrid(np.arange(n) * (2 * math.pi / n), _steps(length, spacing), indexing="ij")
    side = np.stack([np.cos(angles).ravel(), np.sin(angles).ravel(), np.zeros(angles.size)], axis=1)
    points, normals = [side * radius + np.outer(z.ravel(), [0.0, 0.0, 1.0])], [side]
    m = max(12, math.ceil(math.pi * radius**2 / spacing**2))
    # Vogel's sunflower: even on a disc.
    r = radius * np.sqrt((np.arange(m) + 0.5) / m)
    turn = np.arange(m) * math.pi * (3.0 - math.sqrt(5.0))
    for sign in (-1.0, 1.0):
        points.append(np.stack([r * np.cos(turn), r * np.sin(turn), np.full(m, sign * length / 2)], axis=1))
        normals.append(np.tile([0.0, 0.0, sign], (m, 1)))
    return np.concatenate(points), np.concatenate(normals)


def _sample_mesh(mesh: Mesh, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    cross = np.cross(b - a, c - a)
    double_area = np.linalg.norm(cross, axis=1)
    keep = double_area > 1e-12
    a, b, c, cross, double_area = a[keep], b[keep], c[keep], cross[keep], double_area[keep]
    total = float(double_area.sum()) / 2
    n = max(64, math.ceil(total / spacing**2))
    # Even along the running sum of the areas; inside a triangle by Roberts' R2 sequence.
    face = np.searchsorted(np.cumsum(double_area), (np.arange(n) + 0.5) / n * 2 * total, side="right")
    face = np.minimum(face, len(double_area) - 1)
    plastic = 1.32471795724474602596
    u = np.mod(0.5 + np.arange(n) / plastic, 1.0)
    v = np.mod(0.5 + np.arange(n) / plastic**2, 1.0)
    flip = u + v > 1.0
    u, v = np.where(flip, 1.0 - u, u), np.where(flip, 1.0 - v, v)
    points = a[face] + u[:, None] * (b - a)[face] + v[:, None] * (c - a)[face]
    return points, (cross / double_area[:, None])[face]
