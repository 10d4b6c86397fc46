"""How far along a path the base is."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

SPACING = 0.05
WINDOW = 40
"""Points that the base may be further along at once: progress never jumps to a later piece that happens to be close."""


class PathProgress:
    """A path of dense ``points`` (N, 2), metres, and the point of it that the base has come to."""

    def __init__(self, corners: NDArray[np.float64]) -> None:
        self._corners = corners
        self._points = densified(corners, SPACING)
        self._left = metres_left(self._points)
        self._at = 0

    @property
    def remaining(self) -> float:
        """Metres to the end."""
        return float(self._left[self._at])

    @property
    def ahead(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The points still to come (N, 2), and the metres from each to the end (N,)."""
        return self._points[self._at :], self._left[self._at :]

    def advance(self, position: NDArray[np.float64]) -> None:
        """The base is at ``position`` (2,)."""
        window = self._points[self._at : self._at + WINDOW]
        self._at += int(np.argmin(np.linalg.norm(window - position, axis=1)))

    def beside(self, position: NDArray[np.float64]) -> float:
        """Metres between ``position`` (2,) and the point that the base has come to."""
        return float(np.linalg.norm(self._points[self._at] - position))

    def last(self, length: float) -> NDArray[np.float64]:
        """The corners (M, 2) of the last ``length`` metres, their beginning included."""
        begin = int(np.searchsorted(-self._left, -length))
        later = self._corners[metres_left(self._corners) < self._left[begin] - 1e-9]
        return np.vstack([self._points[begin : begin + 1], later])


def metres_left(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """From each point (N, 2) along the others to the last one, (N,)."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.append(np.cumsum(lengths[::-1])[::-1], 0.0)


def densified(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """The same path with points at most ``spacing`` metres apart."""
    pieces = [points[:1]]
    for start, end in itertools.pairwise(points):
        count = math.ceil(float(np.linalg.norm(end - start)) / spacing)
        pieces.append(start + (np.arange(1, count + 1) / max(count, 1))[:, None] * (end - start))
    return np.vstack(pieces)
