"""Segmentation of a view into a support surface and the separate objects on it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, PlacedShape, PointCloud, Pose
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.view import View


def voxel_means(cloud: PointCloud, edge: float) -> PointCloud:
    """Return the mean of position and colour in each cube of ``edge`` metres; ``cloud`` has colours."""
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


Side = Literal["rim", "wall", "hidden", "cut"]
"""The end of a surface: a rim, beyond which the camera sees something lower; a wall; an end hidden by something nearer;
the border of the image.
"""


@dataclass(frozen=True, eq=False)
class Region:
    """The expected location of a support surface, for example from the semantic map with a margin.

    ``frame_from_surface``: pose of the expected surface's centre, z up, in the frame of the view. ``size``: (x, y)
    metres, margins included. The surface is searched within ``tolerance`` metres of the expected height, objects on it
    up to ``height`` metres above it.
    """

    frame_from_surface: Pose
    size: tuple[float, float]
    height: float = 0.40
    tolerance: float = 0.05

    def corners(self) -> NDArray[np.float64]:
        """Return the corners of the box that contains the surface and the objects, (8, 3) metres in the frame of the
        view.
        """
        half_x, half_y = self.size[0] / 2, self.size[1] / 2
        heights = (-self.tolerance, self.height)
        corners = np.array([[x, y, z] for x in (-half_x, half_x) for y in (-half_y, half_y) for z in heights])
        return self.frame_from_surface.apply(corners)


@dataclass(frozen=True, eq=False)
class SupportPlane:
    """A measured, nearly horizontal rectangle.

    ``frame_from_plane``: its centre; z is the normal (upwards), x and y run along the sides, x nearest to the expected
    surface's x. ``size``: (x, y) metres of the visible part. ``rms``: of the inliers' distances, metres. ``inliers``:
    (N, 3) measured points, metres, in the frame. ``outline``: (K, 2) metres in the plane's frame, the convex outline of
    the visible part; empty: the rectangle. ``sides``: how the surface ends at -x, +x, -y, +y, if this was examined;
    else empty.
    """

    frame_from_plane: Pose
    size: tuple[float, float]
    inliers: NDArray[np.float64]
    rms: float
    outline: NDArray[np.float64] | None = None
    sides: tuple[Side, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "inliers", frozen_array(self.inliers, (None, 3), "SupportPlane inliers"))
        x, y = self.size[0] / 2, self.size[1] / 2
        outline = [(-x, -y), (x, -y), (x, y), (-x, y)] if self.outline is None else self.outline
        object.__setattr__(self, "outline", frozen_array(outline, (None, 2), "SupportPlane outline"))

    @property
    def partial(self) -> bool:
        """Return whether the surface may continue beyond the image border or behind an occlusion."""
        return any(side in ("hidden", "cut") for side in self.sides)

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal, (3,), upwards."""
        return self.frame_from_plane.rotation[:, 2]

    @property
    def offset(self) -> float:
        """The offset of the plane: ``normal · p = offset``, metres."""
        return float(self.normal @ self.frame_from_plane.position)

    @property
    def tilt(self) -> float:
        """Angle between normal and vertical, radians."""
        return float(np.arccos(np.clip(self.normal[2], -1.0, 1.0)))

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distances (N,) of points (N, 3) from the plane, metres, positive above."""
        return points @ self.normal - self.offset

    def height_at(self, x: float, y: float) -> float:
        """Return z of the plane at (x, y), metres."""
        a, b, c = self.normal
        return float((self.offset - a * x - b * y) / c)

    def seen_from(self, other_from_frame: Pose) -> SupportPlane:
        """Return the same plane, expressed in another frame."""
        pose = other_from_frame @ self.frame_from_plane
        return replace(self, frame_from_plane=pose, inliers=other_from_frame.apply(self.inliers))

    def slab(self, thickness: float, grow: float = 0.0) -> PlacedShape:
        """Return a box whose top face is the visible rectangle, ``grow`` metres larger on each side, for collision
        worlds.
        """
        size = (self.size[0] + 2 * grow, self.size[1] + 2 * grow, thickness)
        return PlacedShape(Box(size), self.frame_from_plane @ Pose(np.array([0.0, 0.0, -thickness / 2])))


@dataclass(frozen=True, eq=False)
class Cluster:
    """The measured points of one object on a surface.

    ``points``: (N, 3) metres in the frame, about one per voxel. ``colors``: (N, 3) uint8. ``plane``: the surface under
    it. ``at_border``: it touches the border of the image, so a part may be missing.
    """

    points: NDArray[np.float64]
    colors: NDArray[np.uint8]
    plane: SupportPlane
    at_border: bool = False

    def __post_init__(self) -> None:
        points = frozen_array(self.points, (None, 3), "Cluster points")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "colors", frozen_array(self.colors, (len(points), 3), "Cluster colors", np.uint8))

    @cached_property
    def bounding_box(self) -> PlacedShape:
        """The smallest upright box on the plane that contains the points (yaw by ``cv2.minAreaRect``)."""
        local = self.plane.frame_from_plane.inverse().apply(self.points)
        (x, y), (width, depth), degrees = cv2.minAreaRect(local[:, :2].astype(np.float32))
        top = float(np.percentile(local[:, 2], 99.0))
        plane_from_box = Pose.from_xyz_rpy((x, y, top / 2), (0.0, 0.0, float(np.radians(degrees))))
        return PlacedShape(Box((float(width), float(depth), top)), self.plane.frame_from_plane @ plane_from_box)

    def seen_from(self, other_from_frame: Pose) -> Cluster:
        """Return the same cluster, expressed in another frame."""
        points, plane = other_from_frame.apply(self.points), self.plane.seen_from(other_from_frame)
        return replace(self, points=points, plane=plane)

    def obstacle(self, grow: float = 0.0) -> PlacedShape:
        """Return the bounding box, ``grow`` metres larger on each side and at the top, for collision worlds."""
        box = self.bounding_box
        assert isinstance(box.shape, Box)
        x, y, z = box.shape.size
        lifted = box.pose @ Pose(np.array([0.0, 0.0, grow / 2]))
        return PlacedShape(Box((x + 2 * grow, y + 2 * grow, z + grow)), lifted)


@dataclass(frozen=True, eq=False)
class SegmentedScene:
    """The result of a segmentation. ``planes``: largest first. ``clusters``: nearest to the camera first."""

    planes: tuple[SupportPlane, ...]
    clusters: tuple[Cluster, ...]


class Segmentation(ABC):
    """Finds support surfaces in a region and the objects on them."""

    @abstractmethod
    def segment(self, view: View, region: Region, rng: np.random.Generator) -> SegmentedScene:
        """Segment the part of ``view`` that shows ``region``; equal input and generator state give equal output.

        Raises NoSurfaceError, with the reason, if no surface is seen.
        """
