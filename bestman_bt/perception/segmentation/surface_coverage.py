"""What is known of a support surface: free, taken, not there, or not seen; and where there is room on it.

A cell is free where the surface itself was measured. It is absent where a camera ray passes through the plane and hits
something below it: so the surface ends before. What no ray reached is unseen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.messages.frozen_array import frozen_array

UNSEEN, FREE, OCCUPIED, ABSENT = 0, 1, 2, 3


@dataclass(frozen=True, eq=False)
class SurfaceCoverage:
    """A grid on a surface: ``cells`` (rows, columns) uint8 of UNSEEN, FREE, OCCUPIED, ABSENT.

    Row r and column c cover x from ``origin[0] + c * resolution`` and y from ``origin[1] + r * resolution`` in the plane's
    frame. ``frame_from_plane``: as in SupportPlane.
    """

    frame_from_plane: Pose
    cells: NDArray[np.uint8]
    origin: NDArray[np.float64]
    resolution: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells", frozen_array(self.cells, (None, None), "SurfaceCoverage cells", np.uint8))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "SurfaceCoverage origin"))

    def seen_fraction(self) -> float:
        """Share of the surface, not counting absent cells, that was seen free or taken."""
        there = self.cells != ABSENT
        seen = (self.cells == FREE) | (self.cells == OCCUPIED)
        return float(seen.sum() / max(1, there.sum()))

    def free_area(self) -> float:
        """Square metres."""
        return float((self.cells == FREE).sum() * self.resolution**2)

    def disc(self, centre: NDArray[np.float64], radius: float) -> dict[int, float]:
        """Shares of UNSEEN, FREE, OCCUPIED and ABSENT in the disc around ``centre`` (x, y[, z]) of the frame."""
        plane_from_frame = self.frame_from_plane.inverse()
        x, y = plane_from_frame.apply(self._on_plane(centre))[:2]
        rows, columns = np.indices(self.cells.shape)
        distance = np.hypot(
            self.origin[0] + (columns + 0.5) * self.resolution - x, self.origin[1] + (rows + 0.5) * self.resolution - y
        )
        inside = self.cells[distance <= radius]
        # Cells beyond the grid were not looked at: they count as unseen.
        expected = max(len(inside), round(math.pi * radius**2 / self.resolution**2 * 0.97), 1)
        shares = {state: float((inside == state).sum() / expected) for state in (FREE, OCCUPIED, ABSENT)}
        shares[UNSEEN] = max(0.0, 1.0 - sum(shares.values()))
        return shares

    def free_discs(self, radius: float, near: NDArray[np.float64]) -> NDArray[np.float64]:
        """Centres (M, 3), metres in the frame, of discs that lie on free cells only, nearest to ``near`` first.

        ``near``: (2,) or (3,), a point of the frame. Empty (0, 3) where there is no room.
        """
        padded = np.pad((self.cells == FREE).astype(np.uint8), 1)
        clearance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] * self.resolution
        # The distance runs to the next cell's centre; its edge is half a cell nearer.
        rows, columns = np.nonzero(clearance - self.resolution / 2 >= radius)
        local = np.zeros((len(rows), 3))
        local[:, 0] = self.origin[0] + (columns + 0.5) * self.resolution
        local[:, 1] = self.origin[1] + (rows + 0.5) * self.resolution
        centres = self.frame_from_plane.apply(local)
        order = np.argsort(np.linalg.norm(centres[:, :2] - np.asarray(near)[:2], axis=1), kind="stable")
        return centres[order]

    def _on_plane(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        normal = self.frame_from_plane.rotation[:, 2]
        x, y = float(point[0]), float(point[1])
        offset = float(normal @ self.frame_from_plane.position)
        return np.array([x, y, (offset - normal[0] * x - normal[1] * y) / normal[2]])
