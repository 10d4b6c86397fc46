"""RANSAC for the support plane, voxels, and DBSCAN for the things above it.

Fischler and Bolles, "Random Sample Consensus", 1981; Ester et al., "A Density-Based Algorithm for Discovering
Clusters", 1996. All in numpy and scipy, so that equal input gives equal output on any machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bestman_bt.messages import PointCloud, Pose
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.base import (
    Cluster,
    Region,
    Segmentation,
    SegmentedScene,
    SupportPlane,
)
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class PlaneDbscanParameters:
    """Lengths in metres, angles in radians.

    ``min_plane_points``: pixels that a surface must at least fill; at most about ``max_plane_points`` are used.
    ``max_tilt``: of the plane. ``ransac_samples``,
    ``ransac_points``: triples tried, points that judge them; ``ransac_distance``: of an inlier.
    ``min_height``: of things above the plane; three times the plane's rms where that is more.
    ``edge_margin``: a strip along the surface's edge in which nothing is sought (there a wall may begin).
    ``voxel``: edge length. ``cluster_distance``, ``core_points``: DBSCAN's eps and minPts, on voxels of half of eps.
    ``min_cluster_points``: voxels. ``min_cluster_height``: how far a thing must rise.
    ``height_weight``: of vertical distances in it: below 1, since rim and inside of a cup are seen far apart in height.
    ``merge_overlap``: two clusters are one thing where their footprints, grown by ``merge_distance``, overlap by this
    share of the smaller one.
    """

    min_plane_points: int = 1500
    max_plane_points: int = 30000
    max_tilt: float = math.radians(6.0)
    ransac_samples: int = 100
    ransac_points: int = 1500
    ransac_distance: float = 0.008
    min_height: float = 0.008
    edge_margin: float = 0.008
    voxel: float = 0.004
    cluster_distance: float = 0.015
    core_points: int = 4
    height_weight: float = 0.3
    min_cluster_points: int = 40
    min_cluster_height: float = 0.015
    merge_distance: float = 0.012
    merge_overlap: float = 0.15


class PlaneDbscan(Segmentation):
    """One plane near the expected height; what is above its rectangle falls into clusters by distance."""

    def __init__(self, parameters: PlaneDbscanParameters | None = None) -> None:
        self.parameters = parameters or PlaneDbscanParameters()

    def segment(self, view: View, region: Region, rng: np.random.Generator) -> SegmentedScene:
        """See Segmentation."""
        surface_from_frame = region.frame_from_surface.inverse()
        local = view.seen_from(surface_from_frame).cloud(surface_from_frame.apply(region.corners()))
        local = local.selected(_inside(local.points, region))
        plane = self._find_plane(local.points, region, rng)
        above = self._things_above(local, plane, region)
        clusters = self._clusters(above, plane, view)
        clusters.sort(key=lambda cluster: float(np.linalg.norm(cluster.points.mean(axis=0) - view.viewpoint)))
        return SegmentedScene((plane,), tuple(clusters))

    def _find_plane(self, local: NDArray[np.float64], region: Region, rng: np.random.Generator) -> SupportPlane:
        p = self.parameters
        band = local[np.abs(local[:, 2]) <= region.tolerance]
        if len(band) < p.min_plane_points:
            raise NoSurfaceError(_no_surface(region, len(band), p.min_plane_points))
        step = max(1, len(band) // p.max_plane_points)
        band, needed = band[::step], p.min_plane_points // step
        # The plane is z = a x + b y + c in the region's frame.
        judges = band[:: max(1, len(band) // p.ransac_points)]
        triples = judges[rng.integers(len(judges), size=(p.ransac_samples, 3))]
        matrices = np.concatenate([triples[:, :, :2], np.ones((p.ransac_samples, 3, 1))], axis=2)
        usable = np.abs(np.linalg.det(matrices)) > 1e-4
        planes = np.linalg.solve(matrices[usable], triples[usable][:, :, 2:])[:, :, 0]
        planes = planes[np.hypot(planes[:, 0], planes[:, 1]) <= math.tan(p.max_tilt)]
        if len(planes) == 0:
            raise NoSurfaceError(_no_surface(region, 0, p.min_plane_points))
        distances = np.abs(planes[:, :2] @ judges[:, :2].T + planes[:, 2:] - judges[:, 2])
        plane = planes[int(np.argmax((distances < p.ransac_distance).sum(axis=1)))]
        for limit in (1.5 * p.ransac_distance, p.ransac_distance, p.ransac_distance):
            inlier = np.abs(_above_plane(band, plane)) < limit
            if inlier.sum() < needed:
                raise NoSurfaceError(_no_surface(region, int(inlier.sum()) * step, p.min_plane_points))
            plane = _least_squares_plane(band[inlier])
        residuals = _above_plane(band, plane)
        inlier = np.abs(residuals) < p.ransac_distance
        tall = local[_above_plane(local, plane) > 2 * p.ransac_distance]
        surface_from_plane, size = _rectangle(_beside(band[inlier], tall, 0.012), plane)
        inliers = region.frame_from_surface.apply(band[inlier])
        rms = float(np.sqrt(np.mean(residuals[inlier] ** 2)))
        return SupportPlane(region.frame_from_surface @ surface_from_plane, size, inliers, rms)

    def _things_above(self, cloud: PointCloud, plane: SupportPlane, region: Region) -> PointCloud:
        """``cloud`` is in the region's frame; the result in the view's."""
        p = self.parameters
        local = (plane.frame_from_plane.inverse() @ region.frame_from_surface).apply(cloud.points)
        half = np.array(plane.size) / 2 - p.edge_margin
        above = (
            (local[:, 2] > max(p.min_height, 3 * plane.rms))
            & (local[:, 2] < region.height)
            & (np.abs(local[:, 0]) < half[0])
            & (np.abs(local[:, 1]) < half[1])
        )
        return _voxels(cloud.selected(above), p.voxel).transformed(region.frame_from_surface)

    def _clusters(self, cloud: PointCloud, plane: SupportPlane, view: View) -> list[Cluster]:
        p = self.parameters
        if len(cloud) == 0:
            return []
        flattened = plane.frame_from_plane.inverse().apply(cloud.points) * (1.0, 1.0, p.height_weight)
        labels = dbscan(flattened, p.cluster_distance, p.core_points)
        parts = [cloud.selected(labels == label) for label in range(labels.max() + 1)]
        parts = _merge_overlapping([part for part in parts if len(part) >= 5], plane, p.merge_distance, p.merge_overlap)
        clusters = []
        for part in parts:
            rises = float(np.percentile(plane.heights(part.points), 95.0)) >= p.min_cluster_height
            if len(part) >= p.min_cluster_points and rises and part.colors is not None:
                clusters.append(Cluster(part.points, part.colors, plane, _at_border(part.points, view)))
        return clusters


def dbscan(points: NDArray[np.float64], distance: float, core_points: int) -> NDArray[np.int64]:
    """DBSCAN on the occupied voxels of edge ``distance`` / 2: labels (N,) from 0, -1 for noise.

    A voxel is a core where at least ``core_points`` voxels, itself included, lie within ``distance``.
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


def _inside(local: NDArray[np.float64], region: Region) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (
        (np.abs(local[:, 0]) <= region.size[0] / 2)
        & (np.abs(local[:, 1]) <= region.size[1] / 2)
        & (local[:, 2] >= -region.tolerance)
        & (local[:, 2] <= region.height)
    )
    return inside


def _above_plane(points: NDArray[np.float64], plane: NDArray[np.float64]) -> NDArray[np.float64]:
    above: NDArray[np.float64] = points[:, 2] - plane[0] * points[:, 0] - plane[1] * points[:, 1] - plane[2]
    return above


def _least_squares_plane(points: NDArray[np.float64]) -> NDArray[np.float64]:
    centre = points.mean(axis=0)
    x, y, z = (points - centre).T
    # Sums, not dot products: BLAS adds in another order with another number of threads.
    xx, xy, yy, xz, yz = ((a * b).sum() for a, b in ((x, x), (x, y), (y, y), (x, z), (y, z)))
    slopes = np.linalg.solve([[xx, xy], [xy, yy]], [xz, yz])
    return np.array([slopes[0], slopes[1], centre[2] - slopes @ centre[:2]])


def _beside(points: NDArray[np.float64], tall: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """The points that have no tall point above or beside them: the foot of a wall does not belong to a surface."""
    lower = points[:, :2].min(axis=0) - distance
    cells = np.floor((points[:, :2] - lower) / distance).astype(np.int64)
    taken = np.zeros(cells.max(axis=0) + 2, dtype=np.uint8)
    tall_cells = np.floor((tall[:, :2] - lower) / distance).astype(np.int64)
    tall_cells = tall_cells[((tall_cells >= 0) & (tall_cells < taken.shape)).all(axis=1)]
    taken[tall_cells[:, 0], tall_cells[:, 1]] = 1
    taken = cv2.dilate(taken, np.ones((3, 3), dtype=np.uint8))
    beside = points[taken[cells[:, 0], cells[:, 1]] == 0]
    return beside if len(beside) > 100 else points


def _rectangle(inliers: NDArray[np.float64], plane: NDArray[np.float64]) -> tuple[Pose, tuple[float, float]]:
    """The smallest rectangle around the inliers whose sides lie within 6° of the region's axes."""
    hull = cv2.convexHull(inliers[:, :2].astype(np.float32))[:, 0].astype(np.float64)
    sides = np.diff(np.vstack([hull, hull[:1]]), axis=0)
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    turns = np.mod(angles + math.pi / 4, math.pi / 2) - math.pi / 4
    long_sides = np.linalg.norm(sides, axis=1) > 0.02
    best: tuple[float, float, NDArray[np.float64], NDArray[np.float64]] | None = None
    for turn in [0.0, *np.unique(turns[long_sides & (np.abs(turns) < math.radians(6.0))])]:
        c, s = math.cos(turn), math.sin(turn)
        rotated = hull @ np.array([[c, -s], [s, c]])
        lower, upper = rotated.min(axis=0), rotated.max(axis=0)
        area = float(np.prod(upper - lower))
        if best is None or area < best[0]:
            best = (area, float(turn), lower, upper)
    assert best is not None
    _, turn, lower, upper = best
    c, s = math.cos(turn), math.sin(turn)
    x, y = np.array([[c, -s], [s, c]]) @ ((lower + upper) / 2)
    normal = np.array([-plane[0], -plane[1], 1.0]) / math.sqrt(1.0 + plane[0] ** 2 + plane[1] ** 2)
    x_axis = np.array([c, s, plane[0] * c + plane[1] * s])
    x_axis /= np.linalg.norm(x_axis)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x_axis, np.cross(normal, x_axis), normal], axis=1)
    matrix[:3, 3] = x, y, plane[0] * x + plane[1] * y + plane[2]
    return Pose.from_matrix(matrix), (float(upper[0] - lower[0]), float(upper[1] - lower[1]))


def _voxels(cloud: PointCloud, edge: float) -> PointCloud:
    """One point per occupied voxel: the mean of position and colour."""
    if len(cloud) == 0:
        return cloud
    cells = np.floor((cloud.points - cloud.points.min(axis=0)) / edge).astype(np.int64)
    extent = cells.max(axis=0) + 1
    _, voxel_of, counts = np.unique(
        (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2], return_inverse=True, return_counts=True
    )
    assert cloud.colors is not None
    values = [*cloud.points.T, *cloud.colors.T.astype(np.float64)]
    means = np.stack([np.bincount(voxel_of, value) / counts for value in values], axis=1)
    return PointCloud(means[:, :3], np.rint(means[:, 3:]).astype(np.uint8))


def _merge_overlapping(parts: list[PointCloud], plane: SupportPlane, grow: float, share: float) -> list[PointCloud]:
    """Join clusters that overlap seen from above: two things on one surface do not, rim and inside of a cup do."""
    plane_from_frame = plane.frame_from_plane.inverse()
    angles = np.arange(8) * math.pi / 4
    ring = grow * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    hulls = []
    for part in parts:
        outline = plane_from_frame.apply(part.points)[:, None, :2] + ring
        # In millimetres: OpenCV takes areas below 1e-6 for nothing.
        hulls.append(cv2.convexHull((1000.0 * outline).reshape(-1, 2).astype(np.float32)))
    n = len(parts)
    links = np.eye(n, dtype=bool)
    for i in range(n):
        for j in range(i + 1, n):
            common, _ = cv2.intersectConvexConvex(hulls[i], hulls[j])
            smaller = min(cv2.contourArea(hulls[i]), cv2.contourArea(hulls[j]))
            links[i, j] = common > 0.0 and common >= share * smaller
    count, group = connected_components(coo_matrix(links), directed=False)
    merged = []
    for label in range(count):
        members = [parts[i] for i in np.flatnonzero(group == label)]
        colors = [member.colors for member in members if member.colors is not None]
        merged.append(PointCloud(np.concatenate([m.points for m in members]), np.concatenate(colors)))
    return merged


def _at_border(points: NDArray[np.float64], view: View, margin: float = 3.0) -> bool:
    pixels, _ = view.project(points)
    size = np.array([view.image.intrinsics.width, view.image.intrinsics.height])
    return bool((np.nanmin(pixels) < margin) or (np.nanmax(pixels - size) > -1.0 - margin))


def _no_surface(region: Region, found: int, needed: int) -> str:
    x, y, z = region.frame_from_surface.position
    return (
        f"no surface in view near x {x:.2f} y {y:.2f} z {z:.2f} m (±{region.tolerance:.2f} m): "
        f"{found} measured points, at least {needed} are needed"
    )
