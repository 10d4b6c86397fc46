"""Region growing in the depth image: things end where the depth jumps, and along valleys between two of them.

The pixels above the surface are cut into smooth pieces (see depth_fragments), and pieces that can only belong to one
standing thing are joined (see fragment_merging). Neighbours are neighbouring pixels: no search, so that things stay
apart however near they stand, as long as the picture shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PointCloud, Pose
from bestman_bt.perception.segmentation.base import (
    Cluster,
    Region,
    Segmentation,
    SegmentedScene,
    SupportPlane,
    voxel_means,
)
from bestman_bt.perception.segmentation.fragment_merging import FragmentMerging, merge_fragments
from bestman_bt.perception.segmentation.horizontal_plane import HorizontalPlane, inside_region
from bestman_bt.perception.view import View

# Cutting a depth image into smooth pieces: along jumps of the depth, and along valleys between convex things.
# Trevor et al., "Efficient Organized Point Cloud Segmentation with Connected Components", 2013, for the jumps; Stein et
# al., "Object Partitioning using Local Convexity", 2014, for the valleys. A plane is affine in inverse depth, whatever
# its slant, so a second difference of inverse depth tells valleys from slopes without normals.


@dataclass(frozen=True)
class DepthFragments:
    """Parameters for splitting a depth image into smooth fragments. Lengths in metres.

    ``jump``: depth difference between neighbouring pixels, beyond the local slope, that separates fragments.
    ``valley``: depth of a separating valley between two points ``valley_reach`` to its left and right (or above and
    below); scaled with the distance beyond 1 m. ``smoothing``: differences of depth up to about this count as noise.
    ``min_fragment_pixels``: smaller fragments join a neighbour. ``fill``: pixels by which fragments grow back over
    removed borders.
    """

    jump: Annotated[float, "m"] = 0.010
    valley: Annotated[float, "m"] = 0.0033
    valley_reach: Annotated[float, "m"] = 0.010
    smoothing: Annotated[float, "m"] = 0.010
    min_fragment_pixels: Annotated[int, "pixels"] = 12
    fill: Annotated[float, "pixels"] = 6.0


def depth_fragments(
    depth: NDArray[np.float32], mask: NDArray[np.bool_], focal_length: float, p: DepthFragments
) -> NDArray[np.int32]:
    """Return labels (h, w) of the fragments of ``depth`` (metres, 0 unknown) inside ``mask``, from 1; 0 is outside.

    ``focal_length``: pixels.
    """
    mask = mask & (depth > 0)
    if not mask.any():
        return np.zeros(depth.shape, dtype=np.int32)
    smooth = np.asarray(cv2.bilateralFilter(np.where(mask, depth, np.float32(0.0)), 5, p.smoothing, 2.0), np.float32)
    border = _jumps(smooth, mask, p.jump)
    coarse = _components(mask & ~border)
    middle = float(np.median(smooth[mask]))
    reach = int(np.clip(round(p.valley_reach * focal_length / middle), 2, 10))
    valley = _valleys(smooth, coarse, reach, p.valley)
    labels = _components(mask & ~border & ~valley, p.min_fragment_pixels)
    return _filled(labels, mask, smooth, p)


def _jumps(z: NDArray[np.float32], mask: NDArray[np.bool_], limit: float) -> NDArray[np.bool_]:
    """Both pixels of each pair between which the depth changes more than beside them."""
    border = np.zeros(z.shape, dtype=bool)
    for axis in (0, 1):
        values, inside = (z, mask) if axis == 0 else (z.T, mask.T)
        marks = border if axis == 0 else border.T
        step = np.where(inside[1:] & inside[:-1], values[1:] - values[:-1], np.float32(0.0))
        size = np.abs(step)
        beside = np.zeros_like(size)
        beside[1:-1] = np.where(
            (step[1:-1] * step[:-2] > 0) & (step[1:-1] * step[2:] > 0), np.minimum(size[:-2], size[2:]), 0.0
        )
        jump = size - beside > limit
        marks[1:] |= jump
        marks[:-1] |= jump
    return border


def _valleys(z: NDArray[np.float32], labels: NDArray[np.int32], reach: int, limit: float) -> NDArray[np.bool_]:
    """Where a piece lies ``limit`` metres behind the line between its points ``reach`` pixels to both sides."""
    inverse = np.where(labels > 0, 1.0 / np.maximum(z, 1e-3), 0.0).astype(np.float32)
    found = np.zeros(z.shape, dtype=bool)
    for axis in (0, 1):
        w, piece, depth = (inverse, labels, z) if axis == 0 else (inverse.T, labels.T, z.T)
        marks = found if axis == 0 else found.T
        if len(w) <= 2 * reach:
            continue
        middle = slice(reach, -reach)
        same = (piece[middle] > 0) & (piece[: -2 * reach] == piece[middle]) & (piece[2 * reach :] == piece[middle])
        bend = (w[: -2 * reach] + w[2 * reach :]) / 2 - w[middle]
        deep = np.where(same, bend * depth[middle] ** 2, np.float32(0.0)).astype(np.float32)
        # Averaged along the valley, not across it.
        weight = cv2.blur(same.astype(np.float32), (5, 1))
        deep = cv2.blur(deep, (5, 1)) / np.maximum(weight, 0.2)
        # Noise grows with the distance.
        marks[middle] |= same & (deep > limit * np.maximum(1.0, depth[middle]))
    return found


def _components(mask: NDArray[np.bool_], min_pixels: int = 1) -> NDArray[np.int32]:
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    numbers = np.zeros(count, dtype=np.int32)
    kept = np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] >= min_pixels) + 1
    numbers[kept] = np.arange(1, len(kept) + 1)
    components: NDArray[np.int32] = numbers[labels]
    return components


def _filled(
    labels: NDArray[np.int32], mask: NDArray[np.bool_], z: NDArray[np.float32], p: DepthFragments
) -> NDArray[np.int32]:
    """Give the pixels on cuts to the nearest piece, where the depth agrees."""
    if not labels.any():
        return labels
    distance, nearest = cv2.distanceTransformWithLabels(
        (labels == 0).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    seeds = np.zeros(int(nearest.max()) + 1, dtype=np.intp)
    where = np.flatnonzero(labels)
    seeds[nearest.ravel()[where]] = where
    source = seeds[nearest]
    joins = mask & (labels == 0) & (distance <= p.fill) & (np.abs(z.ravel()[source] - z) < 2 * p.jump)
    return np.where(joins, labels.ravel()[source], labels)


_PLANE_STEP = 2
_BORDER = 3


@dataclass(frozen=True)
class RegionGrowing(HorizontalPlane, DepthFragments, FragmentMerging, Segmentation):
    """Finds one plane near the expected height, and splits the points above it into objects at jumps and valleys.

    Lengths in metres; others as in the base classes.

    ``min_height``: of objects above the plane; at least three times the plane's rms. ``edge_margin``: a strip along the
    surface's edge that is not searched (a wall may begin there). ``voxel``: edge length of the voxel filter for
    clusters. ``min_cluster_points``: voxels. ``min_cluster_height``: minimum height of an object.
    """

    min_plane_points: int = 800
    min_height: Annotated[float, "m"] = 0.008
    edge_margin: Annotated[float, "m"] = 0.008
    voxel: Annotated[float, "m"] = 0.004
    min_cluster_points: Annotated[int, "voxels"] = 30
    min_cluster_height: Annotated[float, "m"] = 0.015

    def segment(self, view: View, region: Region, rng: np.random.Generator) -> SegmentedScene:
        """Segment the region by a plane and region growing; see ``Segmentation.segment``."""
        surface_from_frame = region.frame_from_surface.inverse()
        of_surface = view.seen_from(surface_from_frame)
        points, depth, (rows, columns) = of_surface.organised(surface_from_frame.apply(region.corners()))
        inside = inside_region(points, region)
        some = (slice(None, None, _PLANE_STEP), slice(None, None, _PLANE_STEP))
        plane = self.find_plane(points[some][inside[some]], region, rng, _PLANE_STEP**2)
        plane_from_region = plane.frame_from_plane.inverse() @ region.frame_from_surface
        height = _along(points, plane_from_region, 2)
        above = inside & (height > max(self.min_height, 3 * plane.rms)) & (height < region.height)
        if not above.any():
            return SegmentedScene((plane,), ())
        window = _window(above)
        local = np.stack([_along(points[window], plane_from_region, axis) for axis in range(3)], axis=-1)
        half = np.array(plane.size) / 2 - self.edge_margin
        on = above[window] & (np.abs(local[..., 0]) < half[0]) & (np.abs(local[..., 1]) < half[1])
        eye = plane.frame_from_plane.inverse().apply(view.viewpoint)
        labels = merge_fragments(self._pieces(depth[window], on, view), local, depth[window], eye, self)
        first = rows.start + window[0].start, columns.start + window[1].start
        clusters = self._clusters(labels, local, first, plane, view)
        clusters.sort(key=lambda cluster: float(np.linalg.norm(cluster.points.mean(axis=0) - view.viewpoint)))
        return SegmentedScene((plane,), tuple(clusters))

    def _pieces(self, depth: NDArray[np.float32], on: NDArray[np.bool_], view: View) -> NDArray[np.int32]:
        if not on.any():
            return np.zeros(on.shape, dtype=np.int32)
        window = _window(on)
        pieces = np.zeros(on.shape, dtype=np.int32)
        pieces[window] = depth_fragments(depth[window], on[window], view.image.intrinsics.fx, self)
        return pieces

    def _clusters(
        self,
        labels: NDArray[np.int32],
        local: NDArray[np.float64],
        first: tuple[int, int],
        plane: SupportPlane,
        view: View,
    ) -> list[Cluster]:
        """``first``: row and column of the image at which ``labels`` begins."""
        height, width = view.image.depth.shape
        clusters = []
        for label in range(1, int(labels.max()) + 1):
            rows, columns = np.nonzero(labels == label)
            if len(rows) < self.min_cluster_points:
                continue
            v, u = rows + first[0], columns + first[1]
            cloud = voxel_means(PointCloud(local[rows, columns], view.image.rgb[v, u]), self.voxel)
            rises = float(np.percentile(cloud.points[:, 2], 95.0)) >= self.min_cluster_height
            if len(cloud) < self.min_cluster_points or not rises or cloud.colors is None:
                continue
            at_border = min(v.min(), u.min(), height - 1 - v.max(), width - 1 - u.max()) < _BORDER
            points = plane.frame_from_plane.apply(cloud.points)
            clusters.append(Cluster(points, cloud.colors, plane, bool(at_border)))
        return clusters


def _along(points: NDArray[np.float64], pose: Pose, axis: int) -> NDArray[np.float64]:
    """One coordinate (h, w) of ``pose.apply(points)``: term by term, since BLAS adds in an order of its own."""
    a, b, c = pose.rotation[axis]
    moved: NDArray[np.float64] = a * points[..., 0] + b * points[..., 1] + c * points[..., 2]
    moved += pose.position[axis]
    return moved


def _window(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the rows and columns that hold all of ``mask``, and ten pixels around it."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(0, int(rows[0]) - 10), int(rows[-1]) + 11),
        slice(max(0, int(columns[0]) - 10), int(columns[-1]) + 11),
    )
