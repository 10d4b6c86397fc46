"""Planar paths."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose2D


@dataclass(frozen=True, eq=False)
class Path2D:
    """``points``: (N, 2) metres in the map frame, in driving order; ``goal``: the pose to end in.

    ``reverse``: (N - 1,) bool, the segments between the points that are driven backwards; none where left out.
    """

    points: NDArray[np.float64]
    goal: Pose2D
    reverse: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def __post_init__(self) -> None:
        points = frozen_array(self.points, (None, 2), "Path2D points")
        object.__setattr__(self, "points", points)
        segments = max(0, len(points) - 1)
        reverse = self.reverse if len(self.reverse) else np.zeros(segments, dtype=bool)
        object.__setattr__(self, "reverse", frozen_array(reverse, (segments,), "Path2D reverse", np.bool_))

    @property
    def length(self) -> float:
        """Length along the points, metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())
