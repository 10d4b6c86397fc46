"""Unordered points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose


@dataclass(frozen=True, eq=False)
class PointCloud:
    """``points``: (N, 3) float64, metres. ``colors``: (N, 3) uint8 or None. The frame is named by the variable."""

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
        """The same points in another frame."""
        return PointCloud(target_from_source.apply(self.points), self.colors)

    def selected(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> PointCloud:
        """The points that ``index`` (mask or indices) selects."""
        return PointCloud(self.points[index], None if self.colors is None else self.colors[index])
