"""The outline of a base on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex outline around the origin: ``corners`` (N, 2) metres in the base frame, counter-clockwise.

    ``turning_drift``: metres that the origin may wander while the base turns on the spot.
    """

    corners: NDArray[np.float64]
    turning_drift: float = 0.0

    def __post_init__(self) -> None:
        corners = frozen_array(self.corners, (None, 2), "Footprint corners")
        object.__setattr__(self, "corners", corners)
        edges = np.roll(corners, -1, axis=0) - corners
        if len(corners) < 3 or np.any(edges[:, 0] * -corners[:, 1] - edges[:, 1] * -corners[:, 0] <= 0):
            raise ValueError(
                f"Footprint corners should go counter-clockwise around the origin but are {corners.tolist()}"
            )

    @property
    def inscribed_radius(self) -> float:
        """Radius of the largest circle about the origin inside the outline, metres."""
        edges = np.roll(self.corners, -1, axis=0) - self.corners
        cross = edges[:, 0] * -self.corners[:, 1] - edges[:, 1] * -self.corners[:, 0]
        return float(np.min(cross / np.linalg.norm(edges, axis=1)))

    @property
    def circumscribed_radius(self) -> float:
        """Radius of the smallest circle about the origin around the outline, metres."""
        return float(np.linalg.norm(self.corners, axis=1).max())

    @property
    def turning_radius(self) -> float:
        """Radius of the circle about the origin that is swept in a turn on the spot, metres."""
        return self.circumscribed_radius + self.turning_drift

    def outline(self, spacing: float) -> NDArray[np.float64]:
        """Points (N, 2) along the outline, at most ``spacing`` metres apart, corners included."""
        pieces = []
        for start, end in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            count = max(1, int(np.ceil(np.linalg.norm(end - start) / spacing)))
            pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
        return np.concatenate(pieces)
