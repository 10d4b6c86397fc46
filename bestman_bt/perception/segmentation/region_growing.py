"""Region growing in the depth image: things end where the depth jumps, and along valleys between two of them.

The pixels above the surface are cut into smooth pieces (see depth_fragments), and pieces that can only belong to one
standing thing are joined (see fragment_merging). Neighbours are neighbouring pixels: no search, so that things stay
apart however near they stand, as long as the picture shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PointCloud, Pose
from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation, SegmentedScene, SupportPlane
from bestman_bt.perception.segmentation.depth_fragments import DepthFragments, depth_fragments
from bestman_bt.perception.segmentation.fragment_merging import FragmentMerging, merge_fragments
from bestman_bt.perception.segmentation.horizontal_plane import HorizontalPlane, inside_region
from bestman_bt.perception.segmentation.voxels import voxel_means
from bestman_bt.perception.view import View

_PLANE_STEP = 2
_BORDER = 3


@dataclass(frozen=True)
class RegionGrowing(HorizontalPlane, DepthFragments, FragmentMerging, Segmentation):
    """One plane near the expected height; what rises above its rectangle falls into things by jumps and valleys.

    Lengths in metres; others as in the classes from which they come.

    ``min_height``: of things above the plane; three times the plane's rms where that is more.
    ``edge_margin``: a strip along the surface's edge in which nothing is sought (there a wall may begin).
    ``voxel``: edge length of the cubes to which clusters are thinned. ``min_cluster_points``: voxels.
    ``min_cluster_height``: how far a thing must rise.
    """

    min_plane_points: int = 800
    min_height: Annotated[float, "m"] = 0.008
    edge_margin: Annotated[float, "m"] = 0.008
    voxel: Annotated[float, "m"] = 0.004
    min_cluster_points: Annotated[int, "voxels"] = 30
    min_cluster_height: Annotated[float, "m"] = 0.015

    def segment(self, view: View, region: Region, rng: np.random.Generator) -> SegmentedScene:
        """See Segmentation."""
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
    """The rows and columns that hold all of ``mask``, and ten pixels around it."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(0, int(rows[0]) - 10), int(rows[-1]) + 11),
        slice(max(0, int(columns[0]) - 10), int(columns[-1]) + 11),
    )
