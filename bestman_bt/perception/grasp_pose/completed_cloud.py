"""A measured cloud made fit for grasping: smoothed, with normals, and with the sides that no camera saw.

Normals by principal components (Hoppe et al., "Surface Reconstruction from Unorganized Points", 1992), oriented towards
the cameras that saw the point. What was not seen is taken to go straight down to the support from what was: true
for walls, and for overhangs right about the outline, which is what a hand from above meets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_erosion, gaussian_filter
from scipy.spatial import cKDTree

from bestman_bt.messages import PointCloud


@dataclass(frozen=True)
class CloudCompletion:
    """Smooths the cloud of an object and adds the sides that no camera saw.

    Metres. ``voxel``: to which the cloud is thinned, coarser where more than ``max_points`` would remain.

    ``neighbours``: of a point that make its normal, within ``radius``. ``cell``: of the plan in which the outline is
    found; ``column_step``: between the points assumed below it. ``least``: points that an object has at least.
    """

    voxel: Annotated[float, "m"] = 0.004
    max_points: int = 700
    neighbours: int = 20
    radius: Annotated[float, "m"] = 0.014
    cell: Annotated[float, "m"] = 0.005
    column_step: Annotated[float, "m"] = 0.006
    least: int = 25

    def complete(
        self, cloud: PointCloud, viewpoints: NDArray[np.float64] | None, support_height: float
    ) -> CompletedCloud | None:
        """None where too few finite points stand above the support."""
        points = cloud.points[np.isfinite(cloud.points).all(axis=1)]
        points = points[points[:, 2] > support_height]
        voxel = self.voxel
        thinned = _thinned(points, voxel)
        while len(thinned) > self.max_points:
            voxel *= 1.15
            thinned = _thinned(points, voxel)
        if len(thinned) < self.least:
            return None
        points, normals = self._smoothed(points, thinned)
        centre, walls, wall_normals = self._walls(points, support_height)
        normals *= _signs(points, normals, viewpoints, centre)[:, None]
        return CompletedCloud(np.concatenate([points, walls]), np.concatenate([normals, wall_normals]), centre)

    def _smoothed(
        self, points: NDArray[np.float64], thinned: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """``thinned`` put onto the planes through their neighbours among all ``points``, and these planes' normals."""
        count = min(self.neighbours, len(points))
        distances, index = cKDTree(points).query(thinned, k=count, distance_upper_bound=self.radius)
        near = np.isfinite(distances)
        neighbours = points[np.where(near, index, 0)]
        weights = near / near.sum(axis=1, keepdims=True)
        means = (weights[:, :, None] * neighbours).sum(axis=1)
        spread = (neighbours - means[:, None]) * np.sqrt(weights)[:, :, None]
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))
        normals = vectors[:, :, 0]
        # A plane is known where the points spread over two directions; else the point stays.
        known = (near.sum(axis=1) >= 5) & (values[:, 1] > 1e-7)
        offsets = np.einsum("ij,ij->i", thinned - means, normals) * known
        return thinned - normals * offsets[:, None], normals

    def _walls(
        self, points: NDArray[np.float64], support_height: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Centre of mass (3,), and points and normals (M, 3) of walls from the outline down to the support."""
        cell, border = self.cell, 3
        origin = points[:, :2].min(axis=0) - border * cell
        cells = np.floor((points[:, :2] - origin) / cell).astype(np.intp)
        shape = tuple(cells.max(axis=0) + border + 1)
        tops = np.full(shape, support_height)
        np.maximum.at(tops, (cells[:, 0], cells[:, 1]), points[:, 2])
        measured = tops > support_height
        filled = binary_closing(measured, np.ones((3, 3)), iterations=2) | measured
        tops[filled & ~measured] = float(np.median(tops[measured]))
        heights = np.where(filled, tops - support_height, 0.0)
        x, y = np.nonzero(filled)
        weights = heights[x, y]
        plan = origin + (np.column_stack([x, y]) + 0.5) * cell
        centre = np.append(weights @ plan, weights @ (support_height + weights / 2)) / weights.sum()
        outline = filled & ~binary_erosion(filled)
        slope = np.stack(np.gradient(-gaussian_filter(filled.astype(float), 1.5)), axis=2)
        x, y = np.nonzero(outline & measured)
        outward = slope[x, y]
        length = np.linalg.norm(outward, axis=1)
        x, y, outward, length = (values[length > 1e-6] for values in (x, y, outward, length))
        levels = np.arange(support_height + self.column_step / 2, float(tops.max()), self.column_step)
        column, level = np.nonzero(levels[None, :] < tops[x, y][:, None] - self.column_step)
        wall = np.column_stack([origin + (np.column_stack([x, y])[column] + 0.5) * cell, levels[level]])
        normals = np.column_stack([(outward / length[:, None])[column], np.zeros(len(column))])
        return centre, wall, normals


@dataclass(frozen=True, eq=False)
class CompletedCloud:
    """``points``, ``normals``: (N, 3) outward, the measured ones first, then the assumed ones.

    ``centre_of_mass``: (3,) of a body of equal density under what was seen.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    centre_of_mass: NDArray[np.float64]


def _thinned(points: NDArray[np.float64], voxel: float) -> NDArray[np.float64]:
    """The mean of the points in each voxel."""
    if not len(points):
        return points
    _, cell, counts = np.unique(
        np.floor(points / voxel).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, cell.ravel(), points)
    return sums / counts[:, None]


def _signs(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    viewpoints: NDArray[np.float64] | None,
    centre: NDArray[np.float64],
) -> NDArray[np.float64]:
    """+1 or -1 (N,): which side of each point is outside: where a camera saw it from, else away from the middle."""
    outward = points - centre
    if viewpoints is not None:
        towards = np.zeros_like(points)
        for viewpoint in np.asarray(viewpoints, dtype=float).reshape(-1, 3):
            rays = viewpoint - points
            ranges = np.linalg.norm(rays, axis=1)
            directions = rays / ranges[:, None]
            # Seen, if nothing lies clearly in front along the same ray.
            _, others = cKDTree(directions).query(directions, k=min(8, len(points)))
            hidden = ranges > ranges[others].min(axis=1) + 0.015
            towards += np.where(hidden[:, None], 0.0, directions)
        outward = np.where(np.linalg.norm(towards, axis=1)[:, None] > 1e-6, towards, outward)
    return np.where(np.einsum("ij,ij->i", normals, outward) < 0.0, -1.0, 1.0)
