"""The outer surface of a model made of several solid parts: samples, rays through it, centre of mass."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, Mesh, ObjectModel, Shape, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.model_surface import sample_shape

# Gaps between parts that touch, metres: closer than this they are one solid.
_GAP = 5e-4


@dataclass(frozen=True, eq=False)
class SolidSurface:
    """A sampled surface. ``points``, ``normals``: (N, 3) samples of the union's surface in the object frame, metres,
    outward.

    ``triangles``: (F, 3, 3) corners of all parts. ``centre_of_mass``: (3,), for uniform density.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.float64]
    centre_of_mass: NDArray[np.float64]

    def opposite(
        self, points: NDArray[np.float64], directions: NDArray[np.float64], last: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the points and outward normals (R, 3) where rays from surface points (R, 3) along unit inward
        ``directions`` leave the solid.

        This is the first exit, or with ``last`` the last one: beyond the hollow of a cup. NaN if a ray does not start
        inside.
        """
        ends, normals = np.full(points.shape, np.nan), np.full(points.shape, np.nan)
        for i, (point, direction) in enumerate(zip(points, directions, strict=True)):
            distances, outward = _crossings(self.triangles, point - _GAP * direction, direction)
            # A ray enters a part where it meets the triangle's front; it has left the union when it has left all.
            steps = np.where(outward @ direction > 0.0, -1, 1)
            order = np.argsort(distances - _GAP * (steps > 0), kind="stable")
            inside = np.cumsum(steps[order])
            left = np.flatnonzero((inside == 0) & (distances[order] > 2 * _GAP))
            if len(left) and inside.min() >= 0:
                leaving = order[left[-1 if last else 0]]
                ends[i] = point + (distances[leaving] - _GAP) * direction
                normals[i] = outward[leaving]
        return ends, normals


def solid_surface(model: ObjectModel, spacing: float) -> SolidSurface:
    """Sample the collision shapes of ``model`` about every ``spacing`` metres, without samples inside another shape."""
    if not model.collision:
        raise PerceptionError(f"model {model.name!r} has no collision shapes: there is nothing to grasp")
    meshes = [_triangulated(placed.shape) for placed in model.collision]
    for mesh, placed in zip(meshes, model.collision, strict=True):
        mesh.apply_transform(placed.pose.matrix)
    points, normals = [], []
    for i, placed in enumerate(model.collision):
        local_points, local_normals = sample_shape(placed.shape, spacing)
        part_points, part_normals = placed.pose.apply(local_points), local_normals @ placed.pose.rotation.T
        outside = np.ones(len(part_points), dtype=bool)
        for j, other in enumerate(meshes):
            if i != j:
                outside &= ~_contains(np.asarray(other.triangles), part_points + _GAP * part_normals)
        points.append(part_points[outside])
        normals.append(part_normals[outside])
    volumes = np.array([max(abs(float(mesh.volume)), 1e-12) for mesh in meshes])
    centres = np.array([mesh.center_mass if mesh.is_watertight else mesh.centroid for mesh in meshes])
    triangles = np.concatenate([np.asarray(mesh.triangles) for mesh in meshes])
    centre = np.average(centres, axis=0, weights=volumes)
    return SolidSurface(np.concatenate(points), np.concatenate(normals), triangles, centre)


def _triangulated(shape: Shape) -> trimesh.Trimesh:
    match shape:
        case Box():
            mesh: trimesh.Trimesh = trimesh.creation.box(shape.size)
        case Cylinder():
            mesh = trimesh.creation.cylinder(shape.radius, shape.length, sections=48)
        case Sphere():
            mesh = trimesh.creation.icosphere(subdivisions=3, radius=shape.radius)
        case Mesh():
            mesh = trimesh.Trimesh(shape.vertices.copy(), shape.faces.copy(), process=True)
    return mesh


def _contains(triangles: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether points (N, 3) lie inside the closed surface of ``triangles``: rays that leave it an odd number of
    times.

    The direction is oblique, so that it runs along no face of an ordinary shape.
    """
    lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    inside: NDArray[np.bool_] = np.all((points > lower) & (points < upper), axis=1)
    direction = np.array([0.5377, 0.3188, 0.7806])
    direction /= math.sqrt(float(direction @ direction))
    for i in np.flatnonzero(inside):
        inside[i] = len(_crossings(triangles, points[i], direction)[0]) % 2 == 1
    return inside


def _crossings(
    triangles: NDArray[np.float64], origin: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances (M,) at which a ray meets triangles, and their unit normals (M, 3).

    Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
    """
    corner = triangles[:, 0]
    first, second = triangles[:, 1] - corner, triangles[:, 2] - corner
    across = np.cross(direction, second)
    determinant = np.einsum("ij,ij->i", first, across)
    safe = np.where(np.abs(determinant) > 1e-14, determinant, np.nan)
    offset = origin - corner
    u = np.einsum("ij,ij->i", offset, across) / safe
    turned = np.cross(offset, first)
    v = turned @ direction / safe
    distance = np.einsum("ij,ij->i", second, turned) / safe
    hit = np.flatnonzero((u >= 0.0) & (v >= 0.0) & (u + v < 1.0) & (distance > 0.0))
    normals = np.cross(first[hit], second[hit])
    return distance[hit], normals / np.linalg.norm(normals, axis=1)[:, None]
