"""Sensor readings: wrenches, point clouds, laser scans, camera images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose

GRAVITY = 9.81
"""Acceleration by gravity, m/s²."""


@dataclass(frozen=True, eq=False)
class Wrench:
    """A force-torque reading: ``force`` (3,) newtons, ``torque`` (3,) newton metres, in the sensor frame, at ``stamp``
    seconds.
    """

    force: NDArray[np.float64]
    torque: NDArray[np.float64]
    stamp: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", frozen_array(self.force, (3,), "Wrench force"))
        object.__setattr__(self, "torque", frozen_array(self.torque, (3,), "Wrench torque"))


@dataclass(frozen=True, eq=False)
class PointCloud:
    """A point cloud: ``points`` (N, 3) float64, metres; ``colors`` (N, 3) uint8, or None. The frame is given by the
    variable's name.
    """

    points: NDArray[np.float64]
    colors: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        points = frozen_array(self.points, (None, 3), "PointCloud points")
        object.__setattr__(self, "points", points)
        if self.colors is not None:
            colors = frozen_array(self.colors, (len(points), 3), "PointCloud colors", np.uint8)
            object.__setattr__(self, "colors", colors)

    def __len__(self) -> int:
        return len(self.points)

    def transformed(self, target_from_source: Pose) -> PointCloud:
        """Return the same points in another frame."""
        return PointCloud(target_from_source.apply(self.points), self.colors)

    def selected(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> PointCloud:
        """Return the points selected by ``index``, a mask (N,) or indices."""
        return PointCloud(self.points[index], None if self.colors is None else self.colors[index])


@dataclass(frozen=True, eq=False)
class LaserScan:
    """A planar scan as in ROS: beam i points at ``angle_min + i * angle_increment`` in the lidar frame.

    ``ranges``: (N,) float64 metres, inf for beams without a hit between ``range_min`` and ``range_max``. ``stamp``:
    seconds, of the first beam; each further beam is ``time_increment`` seconds later. Raises ValueError for a negative
    or NaN range.
    """

    ranges: NDArray[np.float64]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    stamp: float
    time_increment: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", frozen_array(self.ranges, (None,), "LaserScan ranges"))
        wrong = np.flatnonzero(~(self.ranges >= 0.0))
        if len(wrong):
            first = int(wrong[0])
            raise ValueError(f"LaserScan ranges[{first}] is {self.ranges[first]:g} m; it should be 0 or more, or inf")

    @property
    def angles(self) -> NDArray[np.float64]:
        """Beam angles, (N,) radians."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges), dtype=np.float64)

    def points(self) -> NDArray[np.float64]:
        """Return the hits in the lidar frame, (M, 2) metres, without the beams that hit nothing."""
        hit = np.isfinite(self.ranges)
        ranges, angles = self.ranges[hit], self.angles[hit]
        return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)])


@dataclass(frozen=True)
class CameraIntrinsics:
    """Pinhole model: image size, focal lengths and principal point in pixels (pixel centres at whole numbers).

    ``distortion``: of the lens, as in OpenCV (k1, k2, p1, p2, k3); empty for an ideal or rectified image. Algorithms
    accept only those; the sensor rectifies.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distortion) not in (0, 4, 5):
            raise ValueError(
                "CameraIntrinsics distortion should be empty or (k1, k2, p1, p2) with an optional k3, "
                f"but is {self.distortion}"
            )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The (3, 3) camera matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class RGBDImage:
    """A registered colour and depth image.

    ``rgb``: (H, W, 3) uint8. ``depth``: (H, W) float32, metres along the optical axis, 0 where unknown. ``stamp``:
    seconds of the robot's clock. The optical frame has x right, y down, z forward.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    intrinsics: CameraIntrinsics
    stamp: float

    def __post_init__(self) -> None:
        size = (self.intrinsics.height, self.intrinsics.width)
        object.__setattr__(self, "rgb", frozen_array(self.rgb, (*size, 3), "RGBDImage rgb", np.uint8))
        object.__setattr__(self, "depth", frozen_array(self.depth, size, "RGBDImage depth", np.float32))

    def points(self) -> NDArray[np.float64]:
        """Return the organised points in the optical frame, (H, W, 3) metres, NaN where the depth is unknown.

        Raises ValueError if the image has lens distortion: rectify it first.
        """
        k = self.intrinsics
        if k.distortion:
            raise ValueError(f"the image has lens distortion {k.distortion}; rectify it before computing points")
        z = np.where(np.isfinite(self.depth) & (self.depth > 0), self.depth, np.nan).astype(np.float64)
        u, v = np.meshgrid(np.arange(k.width), np.arange(k.height))
        return np.stack([(u - k.cx) * z / k.fx, (v - k.cy) * z / k.fy, z], axis=-1)
