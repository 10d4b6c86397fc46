"""Convex meshes made smaller by the margin that pybullet puts around them, so that they touch where they are seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from bestman_bt.messages import Mesh

MARGIN = 0.001
"""Metres: how far beyond its corners and faces pybullet takes the hull of a mesh to reach."""


def without_margin(mesh: Mesh, margin: float = MARGIN) -> Mesh:
    """The convex hull of a mesh with all faces moved inwards by ``margin``; less where it is too thin for that."""
    planes = np.unique(ConvexHull(mesh.vertices).equations.round(9), axis=0)
    middle, depth = _deepest_point(planes)
    eroded = planes + np.array([0.0, 0.0, 0.0, min(margin, 0.8 * depth)])
    corners = HalfspaceIntersection(eroded, middle).intersections
    hull = ConvexHull(corners)
    return Mesh(corners, hull.simplices)


def _deepest_point(planes: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The centre (3,) and the radius of the largest ball inside planes (n, 4): normal, offset (a linear program)."""
    rows = np.column_stack([planes[:, :3], np.ones(len(planes))])
    solved = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=-planes[:, 3], bounds=[(None, None)] * 3 + [(0.0, None)])
    return solved.x[:3], float(solved.x[3])
