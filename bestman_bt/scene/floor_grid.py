"""The free floor of a world as a grid: clearances, connected areas, and paths."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from bestman_bt.scene.plane_geometry import Points


@dataclass(frozen=True, eq=False)
class FloorGrid:
    """``room``: (rows, columns) metres from each cell's centre to the nearest obstacle, to half a cell; 0 inside one.

    Row 0 is at the smallest y. ``origin``: (2,) metres in the map frame, the outer corner of cell (0, 0).
    """

    room: NDArray[np.float64]
    origin: NDArray[np.float64]
    resolution: float

    @classmethod
    def of(cls, outlines: Iterable[Points], resolution: float = 0.025) -> FloorGrid:
        """Return the floor between convex counter-clockwise polygons (M, 2), metres; the outside counts as occupied."""
        polygons = list(outlines)
        corners = np.concatenate(polygons)
        origin = corners.min(axis=0)
        columns, rows = np.ceil((corners.max(axis=0) - origin) / resolution).astype(int)
        taken = np.zeros((rows + 2, columns + 2), dtype=bool)
        taken[[0, -1]] = taken[:, [0, -1]] = True
        grid = cls(np.zeros(taken.shape), origin - resolution, resolution)
        for polygon in polygons:
            window, inside = grid._covered(polygon)
            taken[window] |= inside
        return replace(grid, room=ndimage.distance_transform_edt(~taken) * resolution)

    def beside(self, polygon: Points, far: float) -> FloorGrid:
        """Return this floor with another convex polygon (counter-clockwise) as obstacle; clearances are exact up to
        ``far``, metres.

        Equivalent to ``of`` with all outlines, but without recomputing the whole floor.
        """
        window, inside = self._covered(polygon, far)
        room = self.room.copy()
        if inside.any():
            room[window] = np.minimum(room[window], ndimage.distance_transform_edt(~inside) * self.resolution)
        return replace(self, room=room)

    def _covered(self, polygon: Points, around: float = 0.0) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
        """Return the rows and columns of a polygon with a margin ``around`` it, metres, and which of their cells have
        their centre in it.
        """
        low = np.maximum(np.floor((polygon.min(axis=0) - around - self.origin) / self.resolution).astype(int), 0)
        high = np.ceil((polygon.max(axis=0) + around - self.origin) / self.resolution).astype(int) + 1
        high = np.clip(high, low, self.room.shape[::-1])
        x = self.origin[0] + (np.arange(low[0], high[0]) + 0.5) * self.resolution
        y = (self.origin[1] + (np.arange(low[1], high[1]) + 0.5) * self.resolution)[:, None]
        inside = np.ones((len(y), len(x)), dtype=bool)
        for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
        return (slice(low[1], high[1]), slice(low[0], high[0])), inside

    def every(self, count: int) -> FloorGrid:
        """Return a coarser grid: one cell per ``count`` × ``count`` cells, with the clearance at its centre."""
        first = count // 2
        origin = self.origin + (first + 0.5 - count / 2) * self.resolution
        return FloorGrid(self.room[first::count, first::count], origin, count * self.resolution)

    def areas(self, radius: float) -> NDArray[np.intp]:
        """Return (rows, columns) the number of the connected area of a disc's centre; 0: none. ``radius``: metres."""
        labels, _ = ndimage.label(self.room > radius, structure=np.ones((3, 3)))
        return np.asarray(labels, dtype=np.intp)

    def largest_area(self, radius: float) -> NDArray[np.bool_]:
        """Return (rows, columns) where the middle of a disc of this radius can be, in the largest connected area."""
        areas = self.areas(radius)
        sizes = np.bincount(areas.ravel())
        sizes[0] = 0
        largest: NDArray[np.bool_] = (areas > 0) & (areas == int(np.argmax(sizes)))
        return largest

    def cells(self, points: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return rows and columns of map points (..., 2), metres; points outside the grid are clamped to its border."""
        cells = np.floor((np.asarray(points, dtype=float) - self.origin) / self.resolution).astype(np.intp)
        rows, columns = self.room.shape
        return np.clip(cells[..., 1], 0, rows - 1), np.clip(cells[..., 0], 0, columns - 1)

    def points(self, rows: ArrayLike, columns: ArrayLike) -> NDArray[np.float64]:
        """Return the map points (..., 2), metres, at the centres of cells."""
        xy = np.stack([np.asarray(columns, dtype=float), np.asarray(rows, dtype=float)], axis=-1)
        points: NDArray[np.float64] = self.origin + (xy + 0.5) * self.resolution
        return points
