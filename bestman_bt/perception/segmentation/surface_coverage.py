"""Classification of the cells of a support surface (free, occupied, missing, unseen), and its free places.

A cell is free where the surface itself was measured. It is absent where a camera ray passes through the plane and hits
something below it, which shows that the surface ends before. Cells that no ray reached are unseen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.segmentation.base import Region, SegmentedScene
from bestman_bt.perception.view import View

UNSEEN, FREE, OCCUPIED, ABSENT = 0, 1, 2, 3


@dataclass(frozen=True, eq=False)
class SurfaceCoverage:
    """A grid on a surface: ``cells`` (rows, columns) uint8 of UNSEEN, FREE, OCCUPIED, ABSENT.

    Cell (r, c) has its lower corner at x = ``origin[0] + c * resolution``, y = ``origin[1] + r * resolution`` in the
    plane's frame. ``frame_from_plane``: as in SupportPlane.
    """

    frame_from_plane: Pose
    cells: NDArray[np.uint8]
    origin: NDArray[np.float64]
    resolution: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells", frozen_array(self.cells, (None, None), "SurfaceCoverage cells", np.uint8))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "SurfaceCoverage origin"))

    def disc(self, centre: NDArray[np.float64], radius: float) -> dict[int, float]:
        """Return the fractions of UNSEEN, FREE, OCCUPIED and ABSENT in the disc around ``centre`` (x, y[, z]) of the
        frame.
        """
        plane_from_frame = self.frame_from_plane.inverse()
        x, y = plane_from_frame.apply(self._on_plane(centre))[:2]
        rows, columns = np.indices(self.cells.shape)
        distance = np.hypot(
            self.origin[0] + (columns + 0.5) * self.resolution - x, self.origin[1] + (rows + 0.5) * self.resolution - y
        )
        inside = self.cells[distance <= radius]
        # Cells beyond the grid were not looked at: they count as unseen.
        expected = max(len(inside), round(math.pi * radius**2 / self.resolution**2 * 0.97), 1)
        shares = {state: float((inside == state).sum() / expected) for state in (FREE, OCCUPIED, ABSENT)}
        shares[UNSEEN] = max(0.0, 1.0 - sum(shares.values()))
        return shares

    def free_discs(self, radius: float, near: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the centres (M, 3), metres in the frame, of discs that lie on free cells only, nearest to ``near``
        first.

        ``near``: (2,) or (3,), a point of the frame. Empty (0, 3) without free space.
        """
        padded = np.pad((self.cells == FREE).astype(np.uint8), 1)
        clearance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] * self.resolution
        # The distance runs to the next cell's centre; its edge is half a cell nearer.
        rows, columns = np.nonzero(clearance - self.resolution / 2 >= radius)
        local = np.zeros((len(rows), 3))
        local[:, 0] = self.origin[0] + (columns + 0.5) * self.resolution
        local[:, 1] = self.origin[1] + (rows + 0.5) * self.resolution
        centres = self.frame_from_plane.apply(local)
        order = np.argsort(np.linalg.norm(centres[:, :2] - np.asarray(near)[:2], axis=1), kind="stable")
        return centres[order]

    def _on_plane(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        normal = self.frame_from_plane.rotation[:, 2]
        x, y = float(point[0]), float(point[1])
        offset = float(normal @ self.frame_from_plane.position)
        return np.array([x, y, (offset - normal[0] * x - normal[1] * y) / normal[2]])


def surface_coverage(
    view: View, region: Region, scene: SegmentedScene, resolution: float = 0.01, tolerance: float = 0.008
) -> SurfaceCoverage:
    """Classify the cells of the first plane, over the whole region.

    ``scene``: segmented from ``view`` and ``region``. ``resolution``: of the cells, metres. ``tolerance``: maximum
    distance of points on the plane, metres (at least three times the plane's rms).
    """
    plane = scene.planes[0]
    plane_from_frame = plane.frame_from_plane.inverse()
    corners = plane_from_frame.apply(region.corners())[:, :2]
    origin = corners.min(axis=0)
    columns, rows = np.ceil((corners.max(axis=0) - origin) / resolution).astype(int)
    points = view.seen_from(plane_from_frame).cloud(plane_from_frame.apply(region.corners())).points
    eye = plane_from_frame.apply(view.viewpoint)
    height = points[:, 2]
    on_plane = np.abs(height) < max(tolerance, 3 * plane.rms)
    below = points[height < -0.02]
    through = eye + (below - eye) * (eye[2] / (eye[2] - below[:, 2:]))
    above = (height > 2 * max(tolerance, 3 * plane.rms)) & (height < region.height)

    def counts(xy: NDArray[np.float64]) -> NDArray[np.int64]:
        cells = np.floor((xy - origin) / resolution).astype(np.int64)
        cells = cells[((cells >= 0) & (cells < (columns, rows))).all(axis=1)]
        return np.bincount(cells[:, 1] * columns + cells[:, 0], minlength=rows * columns).reshape(rows, columns)

    on, absent, taken = counts(points[on_plane, :2]), counts(through[:, :2]), counts(points[above, :2])
    free = on > absent
    # A lone cell without a point between free ones is a drop-out of the camera, not a hole.
    neighbours = cv2.filter2D(free.astype(np.float32), -1, np.ones((3, 3), dtype=np.float32))
    free |= (neighbours >= 6) & (absent == 0)
    cells = np.full((rows, columns), UNSEEN, dtype=np.uint8)
    cells[free] = FREE
    cells[(absent > 0) & ~free] = ABSENT
    cells[taken > 0] = OCCUPIED
    for cluster in scene.clusters:
        outline = cv2.convexHull(plane_from_frame.apply(cluster.points)[:, :2].astype(np.float32))[:, 0]
        cv2.fillConvexPoly(cells, np.floor((outline - origin) / resolution).astype(np.int32), OCCUPIED)
    return SurfaceCoverage(plane.frame_from_plane, cells, origin, resolution)
