"""Footprints against a distance grid, many poses at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.distance_grid import DistanceGrid

SPACING = 0.04
"""Metres between the points of the outline that are looked at: a tip comes no nearer than half of it unseen."""

Floats = NDArray[np.float32]


class FootprintCheck:
    """Which poses of a base touch something: by its outline, where the place of its middle alone does not tell.

    What stands out above the base is held against the grid's ``tall``.
    """

    def __init__(self, footprint: Footprint) -> None:
        self._outline = footprint.outline(SPACING).astype(np.float32)
        self.inner = np.float32(footprint.inscribed_radius)
        self._outer = np.float32(footprint.circumscribed_radius)
        self._above = None if footprint.overhang is None else FootprintCheck(footprint.above)

    def touches(
        self, grid: DistanceGrid, x: Floats, y: Floats, theta: Floats, margin: float
    ) -> tuple[NDArray[np.bool_], Floats]:
        """For poses of any one shape: whether something is within ``margin`` metres, and how far from the middle."""
        middle = grid.at(x, y)
        margin32 = np.float32(margin)
        touches = middle < self.inner + margin32
        unsure = np.flatnonzero(~touches & (middle < self._outer + margin32))
        if len(unsure):
            around = self._around(grid, x.ravel()[unsure], y.ravel()[unsure], theta.ravel()[unsure])
            touches.ravel()[unsure] = around < margin32 + np.float32(SPACING / 2)
        if self._above is not None and grid.tall is not None:
            touches |= self._above.touches(grid.tall, x, y, theta, margin)[0]
        return touches, middle

    def clearance(self, grid: DistanceGrid, x: Floats, y: Floats, theta: Floats) -> Floats:
        """Metres between outline and next obstacle for poses (N,), at least; negative where they may overlap."""
        around = self._around(grid, x, y, theta) - np.float32(SPACING / 2)
        clearance: Floats = np.minimum(around, grid.at(x, y) - self.inner)
        if self._above is not None and grid.tall is not None:
            clearance = np.minimum(clearance, self._above.clearance(grid.tall, x, y, theta))
        return clearance

    def _around(self, grid: DistanceGrid, x: Floats, y: Floats, theta: Floats) -> Floats:
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        px, py = self._outline.T
        around: Floats = grid.at(x[:, None] + cos * px - sin * py, y[:, None] + sin * px + cos * py).min(axis=1)
        return around
