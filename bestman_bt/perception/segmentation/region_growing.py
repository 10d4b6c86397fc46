"""Region growing in the depth image: objects are separated at depth jumps and along concave valleys.

The pixels above the surface are split into smooth fragments (see depth_fragments), and fragments that can only belong
to one upright object are merged (see fragment_merging). Neighbourhood is that of pixels, without a distance threshold,
so that objects remain separate however close they are, as long as the image shows a boundary.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from typing_extensions import override

from bestman_bt.messages import PointCloud, Pose
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
class FragmentMerging:
    """Rules for merging smooth fragments into objects. Lengths in metres.

    Two fragments are merged in three cases. One is above the other in the top view: the head and the body of a duck.
    One is the hollow inside behind the other: the far wall of a cup. One does not reach down to the surface although
    its lower end is visible: a handle, which is attached to its neighbour.

    ``merge_overlap``: minimum overlap of two footprints of one object, as a fraction of the smaller one.
    ``hollow_depth``: minimum depth of the middle of a hollow below its sides; ``rim_tolerance``: maximum height
    difference between its rim and the wall in front of it. ``foot_height``: a fragment whose lowest points are higher
    does not stand on the surface; ``hidden_share``: fraction of its lower border above which its foot counts as hidden.
    ``contact_distance``: maximum distance of points of touching fragments with adjacent pixels.
    """

    merge_overlap: float = 0.30
    hollow_depth: Annotated[float, "m"] = 0.005
    rim_tolerance: Annotated[float, "m"] = 0.015
    foot_height: Annotated[float, "m"] = 0.025
    hidden_share: float = 0.35
    contact_distance: Annotated[float, "m"] = 0.020


@dataclass(frozen=True, eq=False)
class _Fragment:
    """``local``: (N, 3) points, metres, z above the surface. ``outline``: see footprint."""

    local: NDArray[np.float64]
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    outline: NDArray[np.float32]

    @property
    def top(self) -> float:
        return float(np.percentile(self.local[:, 2], 98.0))


def merge_fragments(
    labels: NDArray[np.int32],
    local: NDArray[np.float64],
    depth: NDArray[np.float32],
    eye: NDArray[np.float64],
    p: FragmentMerging,
) -> NDArray[np.int32]:
    """Return the labels (h, w) of objects, from 1, for the ``labels`` of fragments.

    ``local``: (h, w, 3) points with z above the surface, metres, NaN unknown; ``depth``: (h, w) metres along the
    optical axis, 0 unknown; ``eye``: (3,) the camera in the frame of ``local``.
    """
    count = int(labels.max())
    if count < 2:
        return labels
    fragments = _fragments(labels, local, count)
    links = overlaps([fragment.outline for fragment in fragments]) >= p.merge_overlap
    touching, hides = _borders(labels, depth, local, p, count)
    for i, fragment in enumerate(fragments):
        behind = _hollow_inside(i, fragments, hides, eye, p)
        if behind is not None:
            links[i, behind] = True
        elif _floats(i, fragment, labels, depth, p) and touching[i].any():
            links[i, int(np.argmax(touching[i]))] = True
    _, group = connected_components(coo_matrix(links), directed=False)
    numbers = np.concatenate([[0], group + 1]).astype(np.int32)
    merged: NDArray[np.int32] = numbers[labels]
    return merged


def _fragments(labels: NDArray[np.int32], local: NDArray[np.float64], count: int) -> list[_Fragment]:
    rows, columns = np.nonzero(labels)
    order = np.argsort(labels[rows, columns], kind="stable")
    rows, columns = rows[order], columns[order]
    ends = np.cumsum(np.bincount(labels[rows, columns], minlength=count + 1)[1:])
    fragments = []
    for r, c in zip(np.split(rows, ends[:-1]), np.split(columns, ends[:-1]), strict=True):
        points = local[r, c]
        fragments.append(_Fragment(points, r, c, footprint(points[:, :2])))
    return fragments


def _borders(
    labels: NDArray[np.int32],
    depth: NDArray[np.float32],
    local: NDArray[np.float64],
    p: FragmentMerging,
    count: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return (n, n) numbers of pixel pairs, up to four pixels apart: that touch; and in which row i is hidden by column
    j.
    """
    touching = np.zeros((count + 1, count + 1), dtype=np.int64)
    hides = np.zeros((count + 1, count + 1), dtype=np.int64)
    for axis in (0, 1):
        for gap in (1, 4):
            first = (slice(None, -gap), slice(None)) if axis == 0 else (slice(None), slice(None, -gap))
            second = (slice(gap, None), slice(None)) if axis == 0 else (slice(None), slice(gap, None))
            a, b = labels[first], labels[second]
            where = np.nonzero((a != b) & (a > 0) & (b > 0))
            if len(where[0]) == 0:
                continue
            a, b = a[where], b[where]
            near = np.linalg.norm(local[first][where] - local[second][where], axis=1) <= p.contact_distance
            np.add.at(touching, (a[near], b[near]), 1)
            np.add.at(touching, (b[near], a[near]), 1)
            step = depth[first][where] - depth[second][where]
            np.add.at(hides, (a[step > 0], b[step > 0]), 1)
            np.add.at(hides, (b[step < 0], a[step < 0]), 1)
    return touching[1:, 1:], hides[1:, 1:]


def _hollow_inside(
    i: int,
    fragments: list[_Fragment],
    hides: NDArray[np.int64],
    eye: NDArray[np.float64],
    p: FragmentMerging,
) -> int | None:
    """Return the piece of whose inside ``i`` is the far wall: it stands before it and its rim is as high."""
    if not hides[i].any():
        return None
    inner = fragments[i]
    before = int(np.argmax(hides[i]))
    outer = fragments[before]
    if abs(inner.top - outer.top) > p.rim_tolerance:
        return None
    wall = inner.local[inner.local[:, 2] < inner.top - 0.008]
    if len(wall) < max(12, 0.4 * len(inner.local)):
        return None
    away = inner.local[:, :2].mean(axis=0) - eye[:2]
    away /= max(float(np.linalg.norm(away)), 1e-9)
    along, across = wall[:, :2] @ away, wall[:, :2] @ np.array([-away[1], away[0]])
    half = float(np.percentile(across, 95) - np.percentile(across, 5)) / 2
    if half < 0.004:
        return None
    t = (across - across.mean()) / half
    bend = float(np.polynomial.polynomial.polyfit(t, along, 2)[2])
    return before if -bend > p.hollow_depth else None


def _floats(
    i: int,
    fragment: _Fragment,
    labels: NDArray[np.int32],
    depth: NDArray[np.float32],
    p: FragmentMerging,
) -> bool:
    """Return whether the lower end of piece ``i`` is in view and above the surface."""
    if float(np.percentile(fragment.local[:, 2], 3.0)) <= p.foot_height:
        return False
    lowest = np.full(labels.shape[1], -1)
    np.maximum.at(lowest, fragment.columns, fragment.rows)
    columns = np.flatnonzero(lowest >= 0)
    rows = lowest[columns]
    below = cv2.erode(np.where(depth > 0, depth, np.float32(100.0)), np.ones((3, 3), dtype=np.uint8))
    looked = np.minimum(rows + 4, labels.shape[0] - 1)
    hidden = (below[looked, columns] < depth[rows, columns] - 0.01) | (rows + 4 >= labels.shape[0])
    return bool(hidden.mean() < p.hidden_share)


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
    """Return which pixels have a larger depth difference between them than beside them."""
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
    """Return where a piece lies ``limit`` metres behind the line between its points ``reach`` pixels to both sides."""
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

    @override
    def segment(self, view: View, region: Region, rng: np.random.Generator) -> SegmentedScene:
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
        """Return the clusters. ``first``: row and column of the image at which ``labels`` begins."""
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
    """Return one coordinate (h, w) of ``pose.apply(points)``, summed term by term, since the order of BLAS varies."""
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
