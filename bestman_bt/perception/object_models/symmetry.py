"""The symmetry of a surface about the vertical axis: the rotations that map it onto itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import Mesh

ORDERS = (10, 8, 6, 4, 2)
"""Orders that are tried, highest first; odd ones are omitted, because their axis does not pass through the middle of
the bounding box.
"""

EXACT = 0.2
"""Fraction of the tolerance below which a rotation counts as exact, not as the approximation of another one."""


@dataclass(frozen=True)
class SymmetrySearch:
    """Finds the rotations about z that map a surface onto itself.

    ``tolerance``: maximum deviation of the rotated surface, metres. ``roundness``: the same for rotations by any angle,
    as a fraction of the radius: a prism of 12 sides or more (3.4 %) counts as a cylinder drawn with few triangles, one
    of 10 sides (4.9 %) does not. ``samples``: of the surface; ``tried``: number of them, and of corners, that are
    rotated and compared.
    """

    tolerance: float = 0.0015
    roundness: float = 0.035
    samples: int = 20_000
    tried: int = 3_000

    def order(self, mesh: Mesh) -> int:
        """Return ``ObjectModel.symmetry_order``: 0 for any rotation, 1 for none, else the number of equal rotations
        about z: 2, 4, 6, 8 or 10.

        ``mesh``: in metres, z up; the axis passes through the middle of its bounding box. The same mesh gives the same
        order.
        """
        vertices = mesh.vertices - (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        surface = _Surface(vertices, mesh.faces, self)
        radius = float(np.linalg.norm(vertices[:, :2], axis=1).max())
        round_within = max(self.tolerance, self.roundness * radius)
        # Half a step of each prism: where its corners come to lie over the middles of its faces.
        if all(surface.falls_on_itself(math.pi / sides, round_within) for sides in range(2, 13)):
            return 0
        # An octagonal prism of 56 mm is within the tolerance of tenth turns, too: only multiples of the exact count.
        exact = next((n for n in ORDERS if surface.falls_on_itself(2 * math.pi / n, EXACT * self.tolerance)), 1)
        multiples = [n for n in ORDERS if n % exact == 0]
        return next((n for n in multiples if surface.falls_on_itself(2 * math.pi / n, self.tolerance)), exact)


class _Surface:
    """Triangles, and samples that lead to those near a point."""

    def __init__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], p: SymmetrySearch) -> None:
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        samples, self._faces = trimesh.sample.sample_surface(mesh, p.samples, seed=0)
        self._triangles = vertices[faces]
        self._tree = cKDTree(samples)
        corners = vertices[np.unique(faces)]
        self._tried = np.concatenate([samples[: p.tried], corners[:: -(-len(corners) // p.tried)]])

    def falls_on_itself(self, angle: float, tolerance: float) -> bool:
        """Return whether the surface turned by ``angle`` radians about z is nowhere more than ``tolerance`` metres
        off.
        """
        c, s = math.cos(angle), math.sin(angle)
        turned = self._tried @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        nearby = self._triangles[self._faces[self._tree.query(turned, k=8)[1]]]
        at_most = _distances(turned[:, None], nearby)
        # The samples near a point may miss the triangle that is nearest: who seems to be off is looked at again.
        doubtful = np.flatnonzero(at_most > tolerance)
        doubtful = doubtful[np.argsort(-at_most[doubtful], kind="stable")]
        return all(_distances(turned[i, None, None], self._triangles[None])[0] <= tolerance for i in doubtful)


def _distances(points: NDArray[np.float64], triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance (N,), metres, from points (N, 1, 3) to the nearest of their triangles (N, k, 3, 3)."""
    count, k = triangles.shape[:2]
    each = np.broadcast_to(points, (count, k, 3)).reshape(-1, 3)
    closest_point: Any = trimesh.triangles.closest_point
    closest = closest_point(triangles.reshape(-1, 3, 3), each)
    nearest: NDArray[np.float64] = np.linalg.norm(closest - each, axis=1).reshape(count, k).min(axis=1)
    return nearest
