"""RANSAC for the support plane, voxels, and DBSCAN for the objects above it.

Fischler and Bolles, "Random Sample Consensus", 1981; Ester et al., "A Density-Based Algorithm for Discovering
Clusters", 1996. All in numpy and scipy, so that equal input gives equal output on any machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from typing_extensions import override

from bestman_bt.messages import PointCloud
from bestman_bt.perception.clouds import density_clusters, estimated_normals, thinned, without_outliers
from bestman_bt.perception.segmentation.base import (
    Cluster,
    Region,
    Segmentation,
    SegmentedScene,
    SupportPlane,
    voxel_means,
)
from bestman_bt.perception.segmentation.horizontal_plane import HorizontalPlane, footprint, inside_region, overlaps
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class PlaneDbscan(HorizontalPlane, Segmentation):
    """Finds one plane near the expected height, and clusters the points above its rectangle by distance.

    Lengths in metres, angles in radians; those of the plane as in HorizontalPlane.

    ``min_height``: of objects above the plane; at least three times the plane's rms. ``edge_margin``: a strip along the
    surface's edge that is not searched (a wall may begin there). ``voxel``: edge length. ``cluster_distance``,
    ``core_points``: DBSCAN's eps and minPts, on voxels of half of eps. ``min_cluster_points``: voxels.
    ``min_cluster_height``: minimum height of an object. ``height_weight``: weight of vertical distances; below 1,
    because rim and inside of a cup are seen far apart in height. ``merge_overlap``: two clusters are merged if their
    footprints, enlarged by ``merge_distance``, overlap by this fraction of the smaller one.
    """

    min_height: Annotated[float, "m"] = 0.008
    edge_margin: Annotated[float, "m"] = 0.008
    voxel: Annotated[float, "m"] = 0.004
    cluster_distance: Annotated[float, "m"] = 0.015
    core_points: int = 4
    height_weight: float = 0.3
    min_cluster_points: Annotated[int, "voxels"] = 40
    min_cluster_height: Annotated[float, "m"] = 0.015
    merge_distance: Annotated[float, "m"] = 0.012
    merge_overlap: float = 0.15

    @override
    def segment(self, view: View, region: Region, rng: np.random.Generator) -> SegmentedScene:
        surface_from_frame = region.frame_from_surface.inverse()
        local = view.seen_from(surface_from_frame).cloud(surface_from_frame.apply(region.corners()))
        local = local.selected(inside_region(local.points, region))
        plane = self.find_plane(local.points, region, rng)
        above = self._things_above(local, plane, region)
        clusters = self._clusters(above, plane, view)
        clusters.sort(key=lambda cluster: float(np.linalg.norm(cluster.points.mean(axis=0) - view.viewpoint)))
        return SegmentedScene((plane,), tuple(clusters))

    def _thinned(self, cloud: PointCloud) -> PointCloud:
        """Return one point per voxel."""
        return voxel_means(cloud, self.voxel)

    def _labels(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cluster of each point, from 0; -1 for none."""
        return dbscan(points, self.cluster_distance, self.core_points)

    def _things_above(self, cloud: PointCloud, plane: SupportPlane, region: Region) -> PointCloud:
        """Return the points above the surface. ``cloud`` is in the region's frame; the result in the view's."""
        local = (plane.frame_from_plane.inverse() @ region.frame_from_surface).apply(cloud.points)
        half = np.array(plane.size) / 2 - self.edge_margin
        above = (
            (local[:, 2] > max(self.min_height, 3 * plane.rms))
            & (local[:, 2] < region.height)
            & (np.abs(local[:, 0]) < half[0])
            & (np.abs(local[:, 1]) < half[1])
        )
        return self._thinned(cloud.selected(above)).transformed(region.frame_from_surface)

    def _clusters(self, cloud: PointCloud, plane: SupportPlane, view: View) -> list[Cluster]:
        if len(cloud) == 0:
            return []
        flattened = plane.frame_from_plane.inverse().apply(cloud.points) * (1.0, 1.0, self.height_weight)
        labels = self._labels(flattened)
        parts = [cloud.selected(labels == label) for label in range(labels.max() + 1)]
        parts = self._merged([part for part in parts if len(part) >= 5], plane)
        clusters = []
        for part in parts:
            rises = float(np.percentile(plane.heights(part.points), 95.0)) >= self.min_cluster_height
            if len(part) >= self.min_cluster_points and rises and part.colors is not None:
                clusters.append(Cluster(part.points, part.colors, plane, _at_border(part.points, view)))
        return clusters

    def _merged(self, parts: list[PointCloud], plane: SupportPlane) -> list[PointCloud]:
        """Join clusters that overlap seen from above: two things on one surface do not, rim and inside of a cup do."""
        plane_from_frame = plane.frame_from_plane.inverse()
        outlines = [footprint(plane_from_frame.apply(part.points)[:, :2], self.merge_distance) for part in parts]
        count, group = connected_components(coo_matrix(overlaps(outlines) >= self.merge_overlap), directed=False)
        merged = []
        for label in range(count):
            members = [parts[i] for i in np.flatnonzero(group == label)]
            colors = [member.colors for member in members if member.colors is not None]
            merged.append(PointCloud(np.concatenate([m.points for m in members]), np.concatenate(colors)))
        return merged


def dbscan(points: NDArray[np.float64], distance: float, core_points: int) -> NDArray[np.int64]:
    """Return labels (N,) from 0, -1 for noise, of DBSCAN on the occupied voxels of edge ``distance`` / 2.

    A voxel is a core if at least ``core_points`` voxels, itself included, lie within ``distance``.
    """
    _, voxel_of, counts = np.unique(
        np.floor(points / (distance / 2)).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    voxel_of = voxel_of.reshape(-1)
    centroids = np.stack([np.bincount(voxel_of, points[:, axis]) / counts for axis in range(3)], axis=1)
    pairs = cKDTree(centroids).query_pairs(distance, output_type="ndarray")
    n = len(centroids)
    neighbours = 1 + np.bincount(pairs.reshape(-1), minlength=n)
    core = neighbours >= core_points
    linked = pairs[core[pairs].all(axis=1)]
    _, component = connected_components(coo_matrix((np.ones(len(linked)), linked.T), shape=(n, n)), directed=False)
    # A border voxel joins the lowest component of a core in reach; all others are noise.
    joined = np.where(core, component, n)
    for border, inner in ((pairs[:, 0], pairs[:, 1]), (pairs[:, 1], pairs[:, 0])):
        joins = ~core[border] & core[inner]
        np.minimum.at(joined, border[joins], component[inner[joins]])
    present, labels = np.unique(joined, return_inverse=True)
    labels = labels.reshape(-1).astype(np.int64)
    if present[-1] == n:
        labels[labels == len(present) - 1] = -1
    return labels[voxel_of]


def _at_border(points: NDArray[np.float64], view: View, margin: float = 3.0) -> bool:
    pixels, _ = view.project(points)
    size = np.array([view.image.intrinsics.width, view.image.intrinsics.height])
    return bool((np.nanmin(pixels) < margin) or (np.nanmax(pixels - size) > -1.0 - margin))


_UP = np.array([0.0, 0.0, 1e3])


@dataclass(frozen=True)
class Open3DDbscan(PlaneDbscan):
    """Normals, a seeded RANSAC plane, a voxel filter, an outlier filter and DBSCAN of Open3D (the extra ``open3d``).

    Besides the parameters of PlaneDbscan: ``normal_radius``: of the points from which a normal is estimated.
    ``max_normal_tilt``: points with normals farther from vertical do not belong to the surface. ``outlier_neighbours``,
    ``outlier_ratio``: a point is dropped if its mean distance to that many neighbours is that many standard deviations
    above the mean.
    """

    normal_radius: Annotated[float, "m"] = 0.02
    max_normal_tilt: Annotated[float, "rad"] = 0.5
    outlier_neighbours: int = 8
    outlier_ratio: float = 6.0

    def fit_plane(
        self, points: NDArray[np.float64], rng: np.random.Generator, needed: int
    ) -> tuple[NDArray[np.float64] | None, int]:
        """Fit like ``HorizontalPlane.fit_plane``, to points with vertical normals."""
        thin = thinned(PointCloud(points), self.normal_radius / 4).points
        level = thin[estimated_normals(thin, _UP, self.normal_radius)[:, 2] >= np.cos(self.max_normal_tilt)]
        if len(level) < 3:
            return None, len(level)
        plane, found = super().fit_plane(level, rng, 3)
        return (None, found) if plane is None else self.refined_plane(plane, points, needed)

    def _thinned(self, cloud: PointCloud) -> PointCloud:
        if len(cloud) == 0:
            return cloud
        return without_outliers(thinned(cloud, self.voxel), self.outlier_neighbours, self.outlier_ratio)

    def _labels(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        return density_clusters(points, self.cluster_distance, self.core_points)
