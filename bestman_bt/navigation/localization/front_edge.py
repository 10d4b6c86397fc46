"""The front of a piece of furniture: the line that a lidar sees near its mapped place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.world_model.semantic_map import MapFurniture

GATE = 0.08
"""Distance on each side of the mapped front within which hits are used, metres."""
ENDS = 0.03
"""Length of the front ignored at each end, where beams hit its sides, metres."""
SCALES = np.geomspace(0.08, 0.025, 10)
"""Residual above which a hit is ignored in each iteration, metres, so that handles have no influence."""
MIN_HITS, MIN_LENGTH = 20, 0.2
"""Minimum number of hits on the front, and minimum visible length, metres."""


@dataclass(frozen=True)
class FrontEdge:
    """The error of the mapped front: ``offset`` metres towards the room, at its middle, and ``turn`` radians.

    ``residual``: metres, root mean square of the used hits.
    """

    offset: float
    turn: float
    residual: float

    def corrected(self, piece: MapFurniture, pose: Pose2D) -> Pose2D:
        """Return a pose relative to the mapped ``piece``, corrected by its observed front; the position along it is
        unchanged.
        """
        front = piece.pose @ Pose2D(-piece.footprint[0] / 2, 0.0, 0.0)
        return front @ Pose2D(-self.offset, 0.0, self.turn) @ front.inverse() @ pose


def front_edge(piece: MapFurniture, hits: NDArray[np.float64]) -> FrontEdge | None:
    """Fit the front to ``hits`` (N, 2), metres in the map frame; None if too little of it is visible.

    A total least squares line with Tukey's biweights, iterated with a decreasing scale.
    """
    front = piece.pose @ Pose2D(-piece.footprint[0] / 2, 0.0, 0.0)
    own = front.inverse().apply(hits)
    near = (np.abs(own[:, 0]) < GATE) & (np.abs(own[:, 1]) < piece.footprint[1] / 2 - ENDS)
    x, y = own[near].T
    if len(x) < MIN_HITS or np.ptp(y) < MIN_LENGTH:
        return None
    residuals = x - float(np.median(x))
    turn = middle = 0.0
    for scale in SCALES:
        weights = np.maximum(1.0 - (residuals / scale) ** 2, 0.0) ** 2
        centre = np.array([np.average(x, weights=weights), np.average(y, weights=weights)])
        dx, dy = x - centre[0], y - centre[1]
        turn = 0.5 * math.atan2(-2.0 * float(weights @ (dx * dy)), float(weights @ (dy * dy - dx * dx)))
        residuals = math.cos(turn) * dx + math.sin(turn) * dy
        middle = float(centre[0] + math.tan(turn) * centre[1])
    rms = math.sqrt(float(np.average(residuals**2, weights=weights)))
    return FrontEdge(-middle, turn, rms)
