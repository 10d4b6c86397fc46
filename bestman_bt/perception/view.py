"""An RGB-D image with its camera pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PointCloud, Pose, RGBDImage
from bestman_bt.perception.errors import PerceptionError


@dataclass(frozen=True, eq=False)
class View:
    """An image and ``frame_from_camera``: the pose of the optical frame in a frame with z up (base or map).

    Raises PerceptionError if the image is not that of an ideal pinhole: rectify it first.
    """

    image: RGBDImage
    frame_from_camera: Pose

    def __post_init__(self) -> None:
        k = self.image.intrinsics
        if any(k.distortion):
            raise PerceptionError(f"View: the image has lens distortion {k.distortion}; rectify it first")
        if not (np.isfinite([k.fx, k.fy, k.cx, k.cy]).all() and k.fx > 0 and k.fy > 0):
            raise PerceptionError(f"View: focal lengths should be above 0 but are {k.fx}, {k.fy} (at {k.cx}, {k.cy})")

    @property
    def viewpoint(self) -> NDArray[np.float64]:
        """Return the camera position in the frame, (3,) metres."""
        return self.frame_from_camera.position

    def cloud(self, around: NDArray[np.float64] | None = None) -> PointCloud:
        """Return the measured points in the frame, row by row, without the pixels that have no depth.

        ``around``: (K, 3) metres, corners of a convex body; only the rectangle of pixels that shows it is taken.
        """
        rows, columns = self._window(around)
        k = self.image.intrinsics
        depth = known_depth(self.image.depth[rows, columns]).astype(np.float64)
        known = depth > 0.0
        # p = R ((u - cx) / fx, (v - cy) / fy, 1)ᵀ z + t, with the terms of rows and columns kept apart: much faster.
        x = (np.arange(columns.start, columns.stop) - k.cx) / k.fx
        y = (np.arange(rows.start, rows.stop) - k.cy) / k.fy
        rotation = self.frame_from_camera.rotation
        points = np.empty((int(known.sum()), 3))
        for axis in range(3):
            slope = rotation[axis, 0] * x[None, :] + (rotation[axis, 1] * y + rotation[axis, 2])[:, None]
            points[:, axis] = (slope * depth)[known] + self.frame_from_camera.position[axis]
        points.setflags(write=False)
        return PointCloud(points, self.image.rgb[rows, columns][known])

    def organised(
        self, around: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float32], tuple[slice, slice]]:
        """Return the organised points (h, w, 3) in the frame, the depths (h, w), metres, and the rows and columns that
        they cover.

        Points are NaN and depths 0 where the depth is unknown. ``around``: see ``cloud``.
        """
        rows, columns = self._window(around)
        k = self.image.intrinsics
        depth = known_depth(self.image.depth[rows, columns])
        z = np.where(depth > 0, depth, np.nan).astype(np.float64)
        x = (np.arange(columns.start, columns.stop) - k.cx) / k.fx
        y = (np.arange(rows.start, rows.stop) - k.cy) / k.fy
        rotation = self.frame_from_camera.rotation
        points = np.empty((*z.shape, 3))
        for axis in range(3):
            slope = rotation[axis, 0] * x[None, :] + (rotation[axis, 1] * y + rotation[axis, 2])[:, None]
            points[:, :, axis] = slope * z + self.frame_from_camera.position[axis]
        return points, depth, (rows, columns)

    def seen_from(self, other_from_frame: Pose) -> View:
        """Return the same view, given in another frame."""
        return View(self.image, other_from_frame @ self.frame_from_camera)

    def project(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return pixels (N, 2) as (u, v) and depths (N,), metres, of points (N, 3) of the frame; NaN behind the
        camera.
        """
        k = self.image.intrinsics
        camera_from_frame = self.frame_from_camera.inverse()
        x, y, z = camera_from_frame.apply(points).T
        z = np.where(z > 1e-6, z, np.nan)
        return np.stack([k.cx + k.fx * x / z, k.cy + k.fy * y / z], axis=1), z

    def measured_depth(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the measured depth (N,), metres, at the pixels (N, 2) nearest to (u, v); NaN if unknown or outside the
        image.
        """
        k = self.image.intrinsics
        finite = np.all(np.isfinite(pixels), axis=1)
        nearest = np.rint(np.where(finite[:, None], pixels, -1.0)).astype(np.intp)
        u, v = nearest[:, 0], nearest[:, 1]
        inside: NDArray[np.bool_] = (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)
        depth = np.full(len(pixels), np.nan)
        depth[inside] = self.image.depth[v[inside], u[inside]]
        return np.where(np.isfinite(depth) & np.greater(depth, 0.0), depth, np.nan)

    def _window(self, around: NDArray[np.float64] | None) -> tuple[slice, slice]:
        k = self.image.intrinsics
        everything = slice(0, k.height), slice(0, k.width)
        if around is None:
            return everything
        pixels, _ = self.project(around)
        if not np.isfinite(pixels).all():
            return everything
        size = np.array([k.width, k.height])
        first = np.clip(np.floor(pixels.min(axis=0)), 0, size).astype(int)
        last = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, size).astype(int)
        return slice(int(first[1]), int(last[1])), slice(int(first[0]), int(last[0]))


def known_depth(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the depths with 0 instead of NaN, infinite and negative values."""
    known: NDArray[np.float32] = np.where(np.isfinite(depth) & np.greater(depth, 0.0), depth, np.float32(0.0))
    return known
