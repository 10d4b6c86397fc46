"""Segmentation as PlaneDbscan does it, each operation by Open3D."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PointCloud
from bestman_bt.perception.clouds import density_clusters, estimated_normals, largest_plane, thinned, without_outliers
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan

_UP = np.array([0.0, 0.0, 1e3])


@dataclass(frozen=True)
class Open3DDbscan(PlaneDbscan):
    """Normals, a seeded RANSAC plane, a voxel filter, an outlier filter and DBSCAN of Open3D (the extra ``open3d``).

    Beside the parameters of PlaneDbscan: ``normal_radius``: of the points by which a normal is estimated.
    ``max_normal_tilt``: points whose normals are farther from vertical are not of the surface. ``outlier_neighbours``,
    ``outlier_ratio``: a point of a thing is dropped whose mean distance to that many neighbours is that many standard
    deviations above the usual.
    """

    normal_radius: Annotated[float, "m"] = 0.02
    max_normal_tilt: Annotated[float, "rad"] = 0.5
    outlier_neighbours: int = 8
    outlier_ratio: float = 6.0

    def fit_plane(
        self, points: NDArray[np.float64], rng: np.random.Generator, needed: int
    ) -> tuple[NDArray[np.float64] | None, int]:
        """As ``HorizontalPlane.fit_plane``, by points whose normals are vertical."""
        thin = thinned(PointCloud(points), self.normal_radius / 4).points
        level = thin[estimated_normals(thin, _UP, self.normal_radius)[:, 2] >= np.cos(self.max_normal_tilt)]
        if len(level) < 3:
            return None, len(level)
        a, b, c, d = largest_plane(level, self.ransac_distance, self.ransac_samples, int(rng.integers(2**31)))
        if abs(c) < np.cos(self.max_tilt):
            return None, 0
        return self.refined_plane(np.array([-a / c, -b / c, -d / c]), points, needed)

    def _thinned(self, cloud: PointCloud) -> PointCloud:
        if len(cloud) == 0:
            return cloud
        return without_outliers(thinned(cloud, self.voxel), self.outlier_neighbours, self.outlier_ratio)

    def _labels(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        return density_clusters(points, self.cluster_distance, self.core_points)
