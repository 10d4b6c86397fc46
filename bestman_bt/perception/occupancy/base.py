"""Occupancy mapping: from views of one region to a grid of free, occupied and unknown voxels."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.messages import Pose, VoxelGrid
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.view import View

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
    """Fuses views into the occupancy of one region; the region begins unknown."""

    @abstractmethod
    def begin(self, region: VoxelRegion) -> None:
        """Forget everything and map this region from now on."""

    @abstractmethod
    def add(self, view: View) -> None:
        """Take in one view, given in the frame of the region.

        Pixels without depth say nothing. Raises PerceptionError before ``begin``.
        """

    @abstractmethod
    def grid(self) -> VoxelGrid:
        """What is known now; the stamp is that of the latest view (0 before the first)."""

    def fuse(self, views: Sequence[View], region: VoxelRegion) -> VoxelGrid:
        """The occupancy of a region from these views alone, in their order."""
        self.begin(region)
        for view in views:
            self.add(view)
        return self.grid()
