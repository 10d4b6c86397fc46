"""Detection of recessed edges: openings at the border of a panel with a lip that fingers can hook."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.protrusions import HandleOnFront
from bestman_bt.perception.affordance.rectified import BorderSearch, HeightMap, PanelBorders, RectifiedFront, Side

Kind = Literal["notch", "slot", "strip"]


@dataclass(frozen=True)
class GrooveSearch:
    """Finds lips: borders of a panel next to an opening that fingers can grip.

    Lengths in metres. A *notch* is cut into a border; a *slot* runs between two panels; a vertical *strip* runs along
    the outer border of a door and is open on its other side.

    ``width``: minimum and maximum of a groove: room for fingers, but not a compartment. ``pair_width``: the same where
    two doors meet. ``min_length``: of any lip; ``notch_length``: maximum of a notch. ``strip_length``: minimum of a
    strip, and ``strip_width``: minimum and maximum visible width of its back. ``straightness``: maximum mean deviation
    of a lip from a line. ``panel``: minimum extent of the front beyond a horizontal and a vertical lip. ``flanks``:
    minimum fraction of the lip along which the front is visible; ``ends``: the same beyond its ends. ``depth``: minimum
    visible depth of an opening. ``back``: minimum and maximum distance of the back of a vertical slot or strip: an open
    gap beside a door is not a groove; ``back_slope``: its maximum slope against the front; ``back_share``: minimum
    fraction of the width on which it is visible. ``before``: maximum hidden fraction of an opening. ``grip``: from the
    lip's border to the middle of the gripped part; ``lip``: the lip's thickness; both are assumed. ``position_std``: of
    a detected lip.
    """

    width: Annotated[tuple[float, float], "m"] = (0.027, 0.062)
    pair_width: Annotated[tuple[float, float], "m"] = (0.066, 0.116)
    min_length: Annotated[float, "m"] = 0.105
    notch_length: Annotated[float, "m"] = 0.36
    strip_length: Annotated[float, "m"] = 0.42
    strip_width: Annotated[tuple[float, float], "m"] = (0.013, 0.105)
    straightness: Annotated[float, "m"] = 0.004
    panel: Annotated[tuple[float, float], "m"] = (0.06, 0.10)
    flanks: float = 0.75
    ends: float = 0.6
    depth: Annotated[float, "m"] = 0.03
    back: Annotated[tuple[float, float], "m"] = (0.025, 0.085)
    back_slope: float = 0.6
    back_share: float = 0.06
    before: float = 0.15
    grip: Annotated[float, "m"] = 0.010
    lip: Annotated[float, "m"] = 0.017
    position_std: Annotated[float, "m"] = 0.004

    def find(self, front: RectifiedFront, relief: HeightMap, borders: BorderSearch) -> list[HandleOnFront]:
        """Return the lips of all grooves of a front."""
        found: list[Groove] = []
        for upright in (False, True):
            lying = OrientedFront.of(front, upright)
            kinds: tuple[Kind, ...] = ("notch", "slot", "strip") if upright else ("notch", "slot")
            for kind in kinds:
                for groove in self._components(lying, kind):
                    for part in [groove] if kind == "notch" else self._split_at_seams(groove, front, borders):
                        if all(math.dist(part.centre, other.centre) > 0.04 for other in found):
                            found.append(part)
        return [self._lip(_refined(groove, relief)) for groove in found]

    def _openings(self, lying: OrientedFront, kind: Kind) -> NDArray[np.bool_]:
        """Return the cells that may be grooves of a kind."""
        if kind == "notch":
            return lying.closed(1, lying.cells(self.notch_length)) & ~lying.shown & lying.open
        if kind == "slot":
            width = self.pair_width[1] if lying.upright else self.width[1]
            return lying.closed(lying.cells(width) + 1, 1) & ~lying.shown & lying.open
        with np.errstate(invalid="ignore"):
            back = (lying.height < -self.back[0]) & (lying.height > -self.back[1])
        kernel = np.ones((2 * lying.cells(self.strip_width[1]) + 1, 1), np.uint8)
        return back & (cv2.dilate(lying.shown.astype(np.uint8), kernel) > 0)

    def _components(self, lying: OrientedFront, kind: Kind) -> list[Groove]:
        mask = self._openings(lying, kind).astype(np.uint8)
        thin = lying.cells(0.5 * self.strip_width[0] if kind == "strip" else 0.4 * self.width[0], 2)
        opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((thin, thin), np.uint8))
        opened = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((3, 5), np.uint8))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
        grooves: list[Groove] = []
        for label in range(1, count):
            left, top, width, height, _ = (int(value) for value in stats[label])
            if width * lying.cell >= self.min_length and height * lying.cell >= self.strip_width[0]:
                part = labels[top : top + height, left : left + width] == label
                grooves += self._judge(lying, part, (top, left), kind)
        return grooves

    def _judge(
        self, lying: OrientedFront, part: NDArray[np.bool_], corner: tuple[int, int], kind: Kind
    ) -> list[Groove]:
        cell = lying.cell
        upper, lower = np.argmax(part, axis=0), part.shape[0] - np.argmax(part[::-1], axis=0)
        seen = part.any(axis=0)
        first, last = float(np.median(upper[seen])), float(np.median(lower[seen]))
        full = seen & (part.sum(axis=0) > 0.6 * (last - first))
        if full.sum() * cell < self.min_length:
            return []
        columns = np.flatnonzero(full)
        left, right = int(columns[0]), int(columns[-1]) + 1
        length, width = (right - left) * cell, (last - first) * cell
        place = Rectangle(corner[0] + round(first), corner[0] + round(last), corner[1] + left, corner[1] + right)
        pair = lying.upright and kind != "strip" and self.pair_width[0] <= width <= self.pair_width[1]
        if not self._has_measures(kind, pair, length, width + cell) or not self._is_opening(lying, place):
            return []
        back = (
            lying.back(place, *self.back, self.back_slope, self.back_share)
            if lying.upright and kind != "notch"
            else None
        )
        if lying.upright and kind != "notch" and back is None:
            return []
        (seen_above, reach_above), (seen_below, reach_below) = (
            lying.beside(place, above=above) for above in (True, False)
        )
        flanks, hidden = lying.flanked(place)
        if kind == "notch" and flanks < self.ends:
            return []
        if (kind == "slot" or pair) and min(seen_above, seen_below) < self.flanks:
            return []
        if kind == "strip" and back is not None:
            fits = self.strip_width[0] <= back[1] <= self.strip_width[1]
            if not fits or not lying.ends_in_the_open(place, back[0], panel_above=seen_above > seen_below):
                return []
            # Its outer border lies behind the front: seen from that side it is farther out.
            width = min(width, self.width[1])
        # A level lip belongs to the panel below; an upright one to the door, which is wider than what stands beside it.
        wide_above = reach_above * (seen_above >= self.flanks) > reach_below * (seen_below >= self.flanks)
        sides = (-1.0, 1.0) if pair else (-1.0 if lying.upright and wide_above else 1.0,)
        grooves = []
        for side in sides:
            border, share, reach = (lower, seen_below, reach_below) if side > 0 else (upper, seen_above, reach_above)
            deviation = float(np.abs(border[full] - np.median(border[full])).mean()) * cell
            if share < self.flanks or reach < self.panel[lying.upright] or deviation > self.straightness + 0.5 * cell:
                continue
            row = (place.bottom if side > 0 else place.top) - 0.5
            centre = lying.point(row, 0.5 * (place.start + place.stop) - 0.5)
            confidence = share * (1.0 - 0.3 * deviation / self.straightness) * float(full[left:right].mean())
            inward = side if lying.upright else -side
            breadth = 0.5 * width if pair else width
            grooves.append(Groove(centre, length, breadth, lying.upright, inward, max(0.0, confidence), hidden > 0.5))
        return grooves

    def _split_at_seams(self, groove: Groove, front: RectifiedFront, borders: BorderSearch) -> list[Groove]:
        """Split grooves at the seams of panels: each panel has its part of a groove."""
        x, y = groove.centre
        beside = sorted(groove.inward * distance for distance in (0.012, 0.9 * self.panel[0]))
        half = groove.length / 2 - self.grip
        along = y if groove.upright else x
        if groove.upright:
            low, high = np.array([x + beside[0], y - half]), np.array([x + beside[1], y + half])
        else:
            low, high = np.array([x - half, y + beside[0]]), np.array([x + half, y + beside[1]])
        cuts = sorted(borders.seams(front, low, high, groove.upright))
        ends = [along - groove.length / 2, *cuts, along + groove.length / 2]
        parts = []
        for first, last in pairwise(ends):
            if last - first >= self.min_length:
                middle = 0.5 * (first + last)
                centre = (x, middle) if groove.upright else (middle, y)
                parts.append(replace(groove, centre=centre, length=last - first))
        return parts

    def _has_measures(self, kind: Kind, pair: bool, length: float, width: float) -> bool:
        if kind == "strip":
            # With the side behind its back, which may be seen beside it.
            return length >= self.strip_length and width <= self.strip_width[1] + self.width[1]
        slender = length >= (1.0 if pair else 1.6) * width
        short = kind != "notch" or length <= self.notch_length
        return slender and short and (pair or self.width[0] <= width <= self.width[1] + 0.003)

    def _is_opening(self, lying: OrientedFront, place: Rectangle) -> bool:
        """Return whether something far enough behind the front is seen, and not mainly what hides it."""
        inside = lying.height[place.top : place.bottom, place.start : place.stop]
        known = inside[np.isfinite(inside)]
        if not len(known):
            return False
        return bool((known > 0.01).mean() <= self.before and np.percentile(known, 15) < -self.depth)

    def _lip(self, groove: Groove) -> HandleOnFront:
        x, y = groove.centre
        grip, beyond = groove.inward * self.grip, -groove.inward * groove.width
        if groove.upright:
            side: Side = "right" if beyond > 0 else "left"
            borders = replace(PanelBorders(), **{side: x + beyond})
            middle, angle = np.array([x + grip, y, -self.lip / 2]), math.pi / 2
        else:
            borders = PanelBorders(top=y + beyond) if beyond > 0 else PanelBorders(bottom=y + beyond)
            middle, angle = np.array([x, y + grip, -self.lip / 2]), 0.0
        measures = (middle, angle, self.lip / 2, groove.length, groove.confidence, self.position_std)
        return HandleOnFront("edge", *measures, borders, groove.end_hidden)


@dataclass(frozen=True)
class Groove:
    """A lip, in the frame of its front.

    ``centre``: (x, y) metres, of the lip's border; ``width``: of the opening beyond it. ``upright``: whether it runs
    along y. ``inward``: +1 or -1, to which side along y (upright: x) the lip's panel lies. ``end_hidden``: whether an
    object in front hides an end.
    """

    centre: tuple[float, float]
    length: float
    width: float
    upright: bool
    inward: float
    confidence: float
    end_hidden: bool


def _refined(groove: Groove, relief: HeightMap, reach: float = 0.018) -> Groove:
    """Return the lip's border where pixels change from front to opening, with least error: finer than cells."""
    half = np.array([reach, 0.45 * groove.length] if groove.upright else [0.45 * groove.length, reach])
    low, high = np.array(groove.centre) - half, np.array(groove.centre) + half
    rows, columns = relief.window(low, high, 0.0)
    known = np.nonzero(np.isfinite(relief.height[rows, columns]))
    pixels = (known[0] + rows.start, known[1] + columns.start)
    flat = relief.on_level(pixels, 0.0)
    inside = ((flat > low) & (flat < high)).all(axis=1)
    if inside.sum() < 30:
        return groove
    height, noise = relief.height[pixels][inside], relief.noise[pixels][inside]
    shown = np.abs(height) < np.maximum(0.005, 2.5 * noise)
    across = flat[inside, 0 if groove.upright else 1] * groove.inward
    order = np.argsort(across, kind="stable")
    # Beyond the border (smaller values) openings, within it the front.
    best = int(np.argmax(np.cumsum(np.where(shown[order], -1, 1))))
    border = groove.inward * 0.5 * float(across[order][best] + across[order][min(best + 1, len(order) - 1)])
    x, y = groove.centre
    return replace(groove, centre=(border, y) if groove.upright else (x, border))


@dataclass(frozen=True)
class Rectangle:
    """Cells from row ``top`` to before ``bottom``, from column ``start`` to before ``stop``."""

    top: int
    bottom: int
    start: int
    stop: int


@dataclass(frozen=True, eq=False)
class OrientedFront:
    """A RectifiedFront. ``upright``: whether rows and columns are exchanged. ``shown``: cells that show the front."""

    front: RectifiedFront
    upright: bool
    shown: NDArray[np.bool_]
    open: NDArray[np.bool_]
    height: NDArray[np.float64]

    @classmethod
    def of(cls, front: RectifiedFront, upright: bool) -> OrientedFront:
        """Turn ``front`` where the grooves are upright."""
        shown = cv2.medianBlur(front.on_front.astype(np.uint8), 3) > 0
        if upright:
            height = np.ascontiguousarray(front.height.T)
            return cls(front, True, np.ascontiguousarray(shown.T), np.ascontiguousarray(front.open.T), height)
        return cls(front, False, shown, front.open, front.height)

    @property
    def cell(self) -> float:
        """Edge length of a cell, metres."""
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
