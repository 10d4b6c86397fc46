"""A rectified front, turned so that the grooves that are sought run along its rows; what is seen around openings."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.rectified import RectifiedFront


@dataclass(frozen=True)
class Rectangle:
    """Cells from row ``top`` to before ``bottom``, from column ``start`` to before ``stop``."""

    top: int
    bottom: int
    start: int
    stop: int


@dataclass(frozen=True, eq=False)
class LyingFront:
    """A RectifiedFront. ``upright``: whether rows and columns are exchanged. ``shown``: cells that show the front."""

    front: RectifiedFront
    upright: bool
    shown: NDArray[np.bool_]
    open: NDArray[np.bool_]
    height: NDArray[np.float64]

    @classmethod
    def of(cls, front: RectifiedFront, upright: bool) -> LyingFront:
        """Turn ``front`` where the grooves are upright."""
        shown = cv2.medianBlur(front.on_front.astype(np.uint8), 3) > 0
        if upright:
            height = np.ascontiguousarray(front.height.T)
            return cls(front, True, np.ascontiguousarray(shown.T), np.ascontiguousarray(front.open.T), height)
        return cls(front, False, shown, front.open, front.height)

    @property
    def cell(self) -> float:
        """Metres."""
        return self.front.cell

    def cells(self, metres: float, least: int = 1) -> int:
        """Return a length in metres as a whole number of cells."""
        return max(least, round(metres / self.cell))

    def point(self, row: float, column: float) -> tuple[float, float]:
        """Return x and y of a cell in the front's frame, metres."""
        if self.upright:
            return self.front.x_of(row), self.front.y_of(column)
        return self.front.x_of(column), self.front.y_of(row)

    def closed(self, rows: int, columns: int) -> NDArray[np.bool_]:
        """Return the cells that show the front, and gaps of at most that many cells between them."""
        padded = cv2.copyMakeBorder(
            self.shown.astype(np.uint8), rows, rows, columns, columns, cv2.BORDER_CONSTANT, value=0
        )
        closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((rows, columns), np.uint8))
        result: NDArray[np.bool_] = closed[rows:-rows, columns:-columns] > 0
        return result

    def beside(self, place: Rectangle, *, above: bool) -> tuple[float, float]:
        """Return the fraction of a strip along one long side that shows the front, and the front's extent there,
        metres.

        The front is assumed to continue behind objects that hide it.
        """
        with np.errstate(invalid="ignore"):
            solid = self.shown | (self.height > 0.01)
        margin, reach = self.cells(0.006), self.cells(0.010, 2)
        if above:
            strip = self.shown[
                max(0, place.top - margin - reach) : max(0, place.top - margin), place.start : place.stop
            ]
            rest = solid[: place.top, place.start : place.stop][::-1]
        else:
            strip = self.shown[place.bottom + margin : place.bottom + margin + reach, place.start : place.stop]
            rest = solid[place.bottom :, place.start : place.stop]
        if not rest.size:
            return share(strip), 0.0
        smooth = cv2.morphologyEx(rest.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 1), np.uint8)) > 0
        ended = np.maximum.accumulate(smooth, axis=0) & ~smooth
        lengths = np.where(ended.any(axis=0), np.argmax(ended, axis=0), len(rest))
        return share(strip), float(np.median(lengths)) * self.cell

    def flanked(self, place: Rectangle) -> tuple[float, float]:
        """Return two fractions for the strips beyond both ends of ``place``: the smaller fraction that shows the front
        or something in front of it, and the larger fraction that shows something in front of it.
        """
        margin, reach = self.cells(0.006), self.cells(0.010, 2)
        with np.errstate(invalid="ignore"):
            before = self.height > 0.01
        rows = slice(place.top, place.bottom)
        ends = (
            (rows, slice(max(0, place.start - margin - reach), max(0, place.start - margin))),
            (rows, slice(place.stop + margin, place.stop + margin + reach)),
        )
        return min(share((self.shown | before)[end]) for end in ends), max(share(before[end]) for end in ends)

    def back(
        self, place: Rectangle, nearest: float, farthest: float, slope: float, least: float
    ) -> tuple[float, float] | None:
        """Return level and width, metres, of a back of an opening that is parallel to the front and close behind it.

        None if less than the fraction ``least`` of the opening shows such a back: then only the side wall of the
        furniture or free space is visible.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # rows without any depth
            profile = np.nanmedian(self.height[place.top : place.bottom, place.start : place.stop], axis=1)
        heights = profile[np.isfinite(profile)]
        lag = self.cells(0.005, 2)
        if len(heights) <= lag:
            return None
        level = (heights[lag:] + heights[:-lag]) / 2
        even = np.abs(heights[lag:] - heights[:-lag]) < slope * lag * self.cell
        even &= (level < -nearest) & (level > -farthest)
        if even.mean() < least:
            return None
        middle = float(np.median(level[even]))
        return middle, float((np.abs(heights - middle) < 0.008).sum()) * self.cell

    def ends_in_the_open(self, place: Rectangle, level: float, *, panel_above: bool) -> bool:
        """Return whether a back at ``level`` ends at its border opposite to the panel, and at its ends."""
        margin, reach, far = self.cells(0.008), self.cells(0.010, 2), self.cells(0.030)
        first = place.bottom + margin if panel_above else max(0, place.top - margin - reach)
        beyond = self.height[first : first + reach, place.start : place.stop]
        if np.isfinite(beyond).any() and np.nanmedian(beyond) > level - 0.02:
            return False
        ends = (
            slice(max(0, place.start - far - reach), max(0, place.start - far)),
            slice(place.stop + far, place.stop + far + reach),
        )
        with np.errstate(invalid="ignore"):
            alike = np.abs(self.height[place.top : place.bottom] - level) < 0.01
        return all(share(alike[:, end]) < 0.5 for end in ends)


def share(cells: NDArray[np.bool_]) -> float:
    """Return the fraction of True cells; 0 without cells."""
    return float(cells.mean()) if cells.size else 0.0
