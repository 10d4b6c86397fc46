"""Where the front of a piece of furniture really is: the line that a lidar sees of it, near where the map has it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.messages.bounds import Count, NonNegative, Positive, Several, check_order
from bestman_bt.world_model import MapFurniture


@dataclass(frozen=True)
class FrontEdgeParameters:
    """Lengths in metres.

    ``gate``: on each side of where the map has the front, hits count. ``ends``: of the front that are left out, where
    beams meet its sides. ``first_scale``, ``last_scale``: residual beyond which a hit does not count, in the first
    and in the last of ``iterations``, so that handles do not pull. ``min_hits``, ``min_length``: of what is seen of it.
    """

    gate: Positive = 0.08
    ends: NonNegative = 0.03
    first_scale: Positive = 0.08
    last_scale: Positive = 0.025
    iterations: Count = 10
    min_hits: Several = 20
    min_length: NonNegative = 0.2

    def __post_init__(self) -> None:
        check_order(self, "last_scale", "first_scale")


@dataclass(frozen=True)
class FrontEdge:
    """How the front is off the map: ``offset`` metres towards the room, at the middle of it, and ``turn`` radians.

    ``residual``: metres, root mean square of the hits that count.
    """

    offset: float
    turn: float
    residual: float

    def corrected(self, piece: MapFurniture, pose: Pose2D) -> Pose2D:
        """A pose that was given by where the map has ``piece``, by where its front is; along it nothing changes."""
        front = piece.pose @ Pose2D(-piece.footprint[0] / 2, 0.0, 0.0)
        return front @ Pose2D(-self.offset, 0.0, self.turn) @ front.inverse() @ pose


def front_edge(
    piece: MapFurniture, hits: NDArray[np.float64], parameters: FrontEdgeParameters | None = None
) -> FrontEdge | None:
    """Fit the front to ``hits`` (N, 2), metres in the map frame; None where too little of it is seen.

    A total least squares line with Tukey's biweights of its residuals, computed anew with an ever smaller scale.
    """
    p = parameters or FrontEdgeParameters()
    front = piece.pose @ Pose2D(-piece.footprint[0] / 2, 0.0, 0.0)
    own = front.inverse().apply(hits)
    near = (np.abs(own[:, 0]) < p.gate) & (np.abs(own[:, 1]) < piece.footprint[1] / 2 - p.ends)
    x, y = own[near].T
    if len(x) < p.min_hits or np.ptp(y) < p.min_length:
        return None
    residuals = x - float(np.median(x))
    turn = middle = 0.0
    for scale in np.geomspace(p.first_scale, p.last_scale, p.iterations):
        weights = np.maximum(1.0 - (residuals / scale) ** 2, 0.0) ** 2
        centre = np.array([np.average(x, weights=weights), np.average(y, weights=weights)])
        dx, dy = x - centre[0], y - centre[1]
        turn = 0.5 * math.atan2(-2.0 * float(weights @ (dx * dy)), float(weights @ (dy * dy - dx * dx)))
        residuals = math.cos(turn) * dx + math.sin(turn) * dy
        middle = float(centre[0] + math.tan(turn) * centre[1])
    rms = math.sqrt(float(np.average(residuals**2, weights=weights)))
    return FrontEdge(-middle, turn, rms)
