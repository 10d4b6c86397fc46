"""Planar range scans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True, eq=False)
class LaserScan:
    """A planar scan as in ROS: beam i points at ``angle_min + i * angle_increment`` in the lidar frame.

    ``ranges``: (N,) float64 metres, inf where nothing was hit between ``range_min`` and ``range_max``.
    """

    ranges: NDArray[np.float64]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    stamp: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", frozen_array(self.ranges, (None,), "LaserScan ranges"))

    @property
    def angles(self) -> NDArray[np.float64]:
        """Beam angles, (N,) radians."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges), dtype=np.float64)

    def points(self) -> NDArray[np.float64]:
        """The hits in the lidar frame, (M, 2) metres; beams without a hit are left out."""
        hit = np.isfinite(self.ranges)
        ranges, angles = self.ranges[hit], self.angles[hit]
        return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)])
