"""Occupancy mapping: from views of one region to a grid of free, occupied and unknown voxels."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import (
    VOXEL_FREE,
    VOXEL_OCCUPIED,
    VOXEL_UNKNOWN,
    PlacedShape,
    Pose,
    VoxelGrid,
    distance_to_shape,
)
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.view import View

BELOW = 0.03
"""Depth below a surface down to which a column must be seen, metres: the error of the map."""
ABOVE = 0.06
"""Height above a surface up to which measured or seen-through voxels make a column count as seen, metres."""
HIDDEN = 0.5
"""Fraction of an object's footprint that has to be seen to detect the object."""


def hidden_share(grid: VoxelGrid, frame_from_surface: Pose, size: tuple[float, float], width: float) -> float:
    """Return the unobserved fraction, 0 to 1, of a surface on which an object may stand.

    ``grid``: observed voxels, in the frame. ``size``: of the surface along its x and y, with the middle at its origin,
    metres. ``width``: the smaller side of the object, metres: it is detected if half of the square that it covers was
    observed. Outside the grid, nothing was observed.
    """
    step = grid.resolution
    counts = [max(1, round(extent / step)) for extent in size]
    x, y = ((np.arange(count) + 0.5) * extent / count - extent / 2 for count, extent in zip(counts, size, strict=True))
    z = np.arange(-BELOW, ABOVE + step / 2, step / 2)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    states = grid.state_at(frame_from_surface.apply(points.reshape(-1, 3))).reshape(points.shape[:-1])
    unseen = (states == VOXEL_UNKNOWN).all(axis=2)
    across = min(max(1, round(width / step)), *counts)
    share = cv2.boxFilter(unseen.astype(np.float64), -1, (across, across), borderType=cv2.BORDER_REPLICATE)
    margin = across // 2
    inner = share[margin : counts[0] - margin, margin : counts[1] - margin]
    return float((inner > HIDDEN).mean()) if inner.size else float((share > HIDDEN).mean())


def freed(grid: VoxelGrid, shapes: Iterable[PlacedShape], slack: float = 0.015) -> VoxelGrid:
    """Return the grid after the bodies with these shapes (in its frame) have been removed, for example by the hand.

    Occupied voxels that touch a shape, or are within ``slack`` metres of one, become free.
    """
    states = np.array(grid.states)
    for placed in shapes:
        indices = np.argwhere(states == VOXEL_OCCUPIED)
        centres = grid.frame_from_grid.apply((indices + 0.5) * grid.resolution)
        near = distance_to_shape(centres, placed) <= slack + math.sqrt(3.0) / 2 * grid.resolution
        states[tuple(indices[near].T)] = VOXEL_FREE
    return replace(grid, states=states)


MOST_VOXELS = 20_000_000


@dataclass(frozen=True)
class VoxelRegion:
    """A box to map: ``frame_from_region`` is its centre, ``size`` its extents, ``resolution`` a voxel's edge; metres.

    Raises PerceptionError for sizes that no grid can have.
    """

    frame_from_region: Pose
    size: tuple[float, float, float]
    resolution: float = 0.02

    def __post_init__(self) -> None:
        if not (self.resolution > 0.0 and all(extent >= self.resolution for extent in self.size)):
            raise PerceptionError(
                f"VoxelRegion should be at least one voxel of {self.resolution} m in each direction but is {self.size}"
            )
        x, y, z = self.shape
        if x * y * z > MOST_VOXELS:
            raise PerceptionError(f"VoxelRegion has {x * y * z} voxels, at most {MOST_VOXELS} are mapped")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of voxels along x, y, z."""
        x, y, z = (max(1, round(extent / self.resolution)) for extent in self.size)
        return x, y, z

    @property
    def frame_from_grid(self) -> Pose:
        """The outer corner of voxel (0, 0, 0)."""
        return self.frame_from_region @ Pose.from_xyz_rpy([-n * self.resolution / 2 for n in self.shape])


class OccupancyMapper(ABC):
    """Fuses views into the occupancy of one region."""

    @abstractmethod
    def fuse(self, views: Sequence[View], region: VoxelRegion) -> VoxelGrid:
        """Return the occupancy of a region from these views, given in its frame and in their order; else unknown.

        Pixels without depth are ignored. The grid's stamp is that of the latest view (0 without any).
        """


# Voxel occupancy by log odds, updated by the rays of depth images.
# Hornung et al., "OctoMap: an efficient probabilistic 3D mapping framework based on octrees", Autonomous Robots 2013:
# the same updates with clamping; instead of walking along each ray, every voxel looks up the ray that passes through
# it.


@dataclass(frozen=True)
class LogOdds(OccupancyMapper):
    """A dense grid: occupied at measured points, free along the rays; within one view, occupied has priority.

    ``hit``, ``miss``: log odds that a view adds to a voxel with a surface, or subtracts from one that it sees through.
    ``limit``: log odds stay within ±``limit``; small, so that two views clear a moved object. ``min_hits``: measured
    points that make a voxel occupied. ``noise_base``, ``noise_quadratic``: depth noise, as in CameraPart; a ray frees
    voxels up to ``noise_deviations`` standard deviations before the surface. ``max_range``: trusted distance along the
    optical axis, metres.
    """

    hit: float = 0.85
    miss: float = 0.65
    limit: float = 1.2
    min_hits: int = 3
    noise_base: Annotated[float, "m"] = 0.0012
    noise_quadratic: Annotated[float, "1/m"] = 0.0019
    noise_deviations: float = 3.0
    max_range: Annotated[float, "m"] = 5.0

    @override
    def fuse(self, views: Sequence[View], region: VoxelRegion) -> VoxelGrid:
        odds, seen = np.zeros(region.shape, dtype=np.float32), np.zeros(region.shape, dtype=bool)
        for view in views:
            depth = view.image.depth
            trusted = np.isfinite(depth) & (depth > 0.0) & (depth <= self.max_range)
            depth = np.where(trusted, depth, np.float32(0.0))
            surface = self._surface(view, depth, region)
            free = self._seen_through(view, depth, region) & ~surface
            odds[surface] += self.hit
            odds[free] -= self.miss
            np.clip(odds, -self.limit, self.limit, out=odds)
            seen |= surface | free
        states = np.where(seen, np.where(odds > 0.0, VOXEL_OCCUPIED, VOXEL_FREE), VOXEL_UNKNOWN).astype(np.uint8)
        stamp = max((view.image.stamp for view in views), default=0.0)
        return VoxelGrid(states, region.resolution, region.frame_from_grid, stamp)

    def _surface(self, view: View, depth: NDArray[np.float32], region: VoxelRegion) -> NDArray[np.bool_]:
        """Return voxels with at least ``min_hits`` measured points."""
        k = view.image.intrinsics
        grid_from_camera = region.frame_from_grid.inverse() @ view.frame_from_camera
        rotation = (grid_from_camera.rotation / region.resolution).astype(np.float32)
        origin = (grid_from_camera.position / region.resolution).astype(np.float32)
        x = ((np.arange(k.width) - k.cx) / k.fx).astype(np.float32)
        y = ((np.arange(k.height) - k.cy) / k.fy).astype(np.float32)
        inside = depth > 0.0
        index = np.zeros(depth.shape, dtype=np.int32)
        for axis, count in enumerate(region.shape):
            slope = rotation[axis, 0] * x[None, :] + (rotation[axis, 1] * y + rotation[axis, 2])[:, None]
            along = slope * depth + origin[axis]
            inside &= (along >= 0.0) & (along < count)
            index = index * count + np.where(inside, along, 0.0).astype(np.int32)
        hits = np.bincount(index[inside], minlength=int(np.prod(region.shape)))
        return (hits >= self.min_hits).reshape(region.shape)

    def _seen_through(self, view: View, depth: NDArray[np.float32], region: VoxelRegion) -> NDArray[np.bool_]:
        """Return voxels whose centre lies before the depth of its pixel by more than the voxel's half diagonal and
        noise.
        """
        k = view.image.intrinsics
        camera_from_grid = view.frame_from_camera.inverse() @ region.frame_from_grid
        rotation = (camera_from_grid.rotation * region.resolution).astype(np.float32)
        x, y, z = (np.arange(count, dtype=np.float32) + np.float32(0.5) for count in region.shape)
        seen = np.zeros(region.shape, dtype=bool)
        position = camera_from_grid.position.astype(np.float32)
        noise = self.noise_base + self.noise_quadratic * np.clip(depth - 0.4, 0.0, None) ** 2
        nearest = depth - self.noise_deviations * noise - region.resolution * np.sqrt(3.0) / 2
        reach = np.where(depth > 0.0, nearest, 0.0).astype(np.float32).ravel()
        for i in range(len(x)):  # slices along x keep the intermediate arrays small enough for the cache
            u, v, w = (
                rotation[row, 0] * x[i] + position[row] + rotation[row, 1] * y[:, None] + rotation[row, 2] * z[None, :]
                for row in range(3)
            )
            before = w > np.float32(1e-3)
            inverse = np.where(before, w, np.float32(1.0))
            column = np.rint(u / inverse * np.float32(k.fx) + np.float32(k.cx))
            row_ = np.rint(v / inverse * np.float32(k.fy) + np.float32(k.cy))
            before &= (column >= 0) & (column < k.width) & (row_ >= 0) & (row_ < k.height)
            pixel = np.where(before, row_ * k.width + column, 0).astype(np.int32)
            seen[i] = before & (w < reach[pixel])
        return seen
