"""Planar paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose2D


@dataclass(frozen=True, eq=False)
class Path2D:
    """``points``: (N, 2) metres in the map frame, in driving order; ``goal``: the pose to end in."""

    points: NDArray[np.float64]
    goal: Pose2D

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen_array(self.points, (None, 2), "Path2D points"))

    @property
    def length(self) -> float:
        """Length along the points, metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())
