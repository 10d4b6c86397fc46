"""Recessed edges: openings at the border of a panel, whose lip fingers reach over and hook."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.handle_on_front import HandleOnFront
from bestman_bt.perception.affordance.panel_borders import PanelBorders, Side
from bestman_bt.perception.affordance.rectified import RectifiedFront
from bestman_bt.perception.affordance.relief import Relief

Kind = Literal["notch", "slot", "strip"]
KINDS: tuple[Kind, ...] = ("notch", "slot", "strip")


@dataclass(frozen=True)
class GroovesParameters:
    """Lengths in metres.

    ``width``: of a groove, least and most: room for fingers, no compartment. ``pair_width``: of two that meet, where two
    doors do. ``notch_length``: most length of one that is cut into a border; others run between two panels.
    ``strip_length``, ``strip_width``: least length and seen width of one along the outer border of a door, open on its
    other side. ``plate_slope``: most slope of an upright groove's back against the front; ``plate_share``: least share
    of its width on which that is seen. ``panel``: that the front at least goes on from a level, from an
    upright lip.
    ``min_length``: of any. ``straightness``: most mean deviation of its lip from a line.
    ``flanks``: least share of its lip and of its ends along which the front is seen.
    ``back``: distance of what is seen in an upright groove, least and most: an open gap beside a door is none.
    ``before``: most share of an opening that something hides.
    ``grip``: from the lip's border to the middle of what fingers hold; ``lip``: the lip's thickness. Neither is seen.
    """

    width: tuple[float, float] = (0.027, 0.062)
    pair_width: tuple[float, float] = (0.066, 0.116)
    notch_length: float = 0.36
    min_length: float = 0.105
    straightness: float = 0.004
    strip_length: float = 0.42
    strip_width: float = 0.013
    plate_slope: float = 0.4
    plate_share: float = 0.06
    panel: tuple[float, float] = (0.06, 0.15)
    flanks: float = 0.75
    back: tuple[float, float] = (0.025, 0.085)
    before: float = 0.15
    grip: float = 0.010
    lip: float = 0.017
    position_std: float = 0.004


@dataclass(frozen=True)
class Groove:
    """A lip, in the frame of its front.

    ``centre``: (x, y) metres, of the lip's border; ``width``: of the opening beyond it. ``upright``: whether it runs along y. ``inward``: +1 or -1, to which
    side along y (upright: x) the lip's panel lies.
    """

    centre: tuple[float, float]
    length: float
    width: float
    upright: bool
    inward: float
    confidence: float


def find_grooves(front: RectifiedFront, relief: Relief, parameters: GroovesParameters) -> list[HandleOnFront]:
    """The lips of all grooves of a front."""
    found: list[Groove] = []
    for upright in (False, True):
        lying = _lying(front, upright)
        for kind in KINDS if upright else KINDS[:2]:
            for groove in _components(lying, kind, upright, parameters):
                if all(math.dist(groove.centre, other.centre) > 0.04 for other in found):
                    found.append(groove)
    return [_lip(_refined(groove, relief), parameters) for groove in found]


@dataclass(frozen=True, eq=False)
class _Lying:
    """The cells of a front, turned so that the grooves that are sought run along the rows."""

    shown: NDArray[np.bool_]
    open: NDArray[np.bool_]
    height: NDArray[np.float64]
    outside: NDArray[np.bool_]
    front: RectifiedFront

    @property
    def cell(self) -> float:
        return self.front.cell


def _lying(front: RectifiedFront, upright: bool) -> _Lying:
    shown = cv2.medianBlur(front.on_front.astype(np.uint8), 3) > 0
    fields = (shown, front.open, front.height, front.outside)
    return _Lying(*(np.ascontiguousarray(field.T) if upright else field for field in fields), front)  # type: ignore[arg-type]


def _openings(lying: _Lying, kind: Kind, upright: bool, p: GroovesParameters) -> NDArray[np.bool_]:
    """The cells that may be grooves of a kind."""
    if kind == "notch":
        return _closed(lying.shown, (1, round(p.notch_length / lying.cell))) & ~lying.shown & lying.open
    if kind == "slot":
        width = p.pair_width[1] if upright else p.width[1]
        return _closed(lying.shown, (round(width / lying.cell) + 1, 1)) & ~lying.shown & lying.open
    with np.errstate(invalid="ignore"):
        plate = (lying.height < -p.back[0]) & (lying.height > -p.back[1])
    reach = 2 * round(p.width[1] / lying.cell) + 1
    return plate & (cv2.dilate(lying.shown.astype(np.uint8), np.ones((reach, 1), np.uint8)) > 0)


def _closed(shown: NDArray[np.bool_], size: tuple[int, int]) -> NDArray[np.bool_]:
    rows, columns = size
    padded = cv2.copyMakeBorder(shown.astype(np.uint8), rows, rows, columns, columns, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((rows, columns), np.uint8))
    result: NDArray[np.bool_] = closed[rows : rows + shown.shape[0], columns : columns + shown.shape[1]] > 0
    return result


def _components(lying: _Lying, kind: Kind, upright: bool, p: GroovesParameters) -> list[Groove]:
    mask = _openings(lying, kind, upright, p)
    thin = max(2, round(0.5 * p.strip_width / lying.cell))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((thin, thin), np.uint8))
    opened = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((3, 5), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
    grooves: list[Groove] = []
    for label in range(1, count):
        left, top, width, height, _ = (int(value) for value in stats[label])
        if width * lying.cell < p.min_length or height * lying.cell < p.strip_width:
            continue
        part = labels[top : top + height, left : left + width] == label
        grooves += _judge(lying, part, (top, left), kind, upright, p)
    return grooves


def _judge(
    lying: _Lying, part: NDArray[np.bool_], corner: tuple[int, int], kind: Kind, upright: bool, p: GroovesParameters
) -> list[Groove]:
    cell = lying.cell
    upper, lower = np.argmax(part, axis=0), part.shape[0] - np.argmax(part[::-1], axis=0)
    column_seen = part.any(axis=0)
    first, last = float(np.median(upper[column_seen])), float(np.median(lower[column_seen]))
    full = column_seen & (part.sum(axis=0) > 0.6 * (last - first))
    if full.sum() * cell < p.min_length:
        return []
    columns = np.flatnonzero(full)
    left, right = int(columns[0]), int(columns[-1]) + 1
    length, width = (right - left) * cell, (last - first) * cell
    pair = upright and kind != "strip" and p.pair_width[0] <= width <= p.pair_width[1]
    if kind == "strip":
        fits = width <= 2 * p.width[1]  # with the side behind its back
    else:
        fits = pair or p.width[0] - cell <= width <= p.width[1]
    if not fits or length < (1.0 if pair else 1.6) * width:
        return []
    if (kind == "notch" and length > p.notch_length) or (kind == "strip" and length < p.strip_length):
        return []
    top, bottom = corner[0] + round(first), corner[0] + round(last)
    start, stop = corner[1] + left, corner[1] + right
    reach = max(2, round(0.010 / cell))
    inside = lying.height[top:bottom, start:stop]
    with np.errstate(invalid="ignore"):
        if (inside > 0.01).mean() > p.before:
            return []
    plate = _plate(inside, cell, p) if upright and kind != "notch" else None
    if upright and kind != "notch" and plate is None:
        return []
    margin = max(1, round(0.006 / cell))
    above = lying.shown[max(0, top - margin - reach) : max(0, top - margin), start:stop]
    below = lying.shown[bottom + margin : bottom + margin + reach, start:stop]
    with np.errstate(invalid="ignore"):
        solid = lying.shown | (lying.height > 0.01)
    ends = [
        solid[top:bottom, max(0, start - margin - reach) : max(0, start - margin)],
        solid[top:bottom, stop + margin : stop + margin + reach],
    ]
    seen_above, seen_below = _share(above), _share(below)
    if kind == "notch" and min(_share(end) for end in ends) < 0.8 * p.flanks:
        return []
    if (kind == "slot" or pair) and min(seen_above, seen_below) < p.flanks:
        return []
    if kind == "strip" and plate is not None:
        place = (top, bottom, start, stop)
        narrow = not p.strip_width <= plate[1] <= p.width[1]
        if narrow or not _ends_in_the_open(lying, place, plate[0], seen_above > seen_below):
            return []
    reach_above, reach_below = _run(lying.shown, top, -1, start, stop), _run(lying.shown, bottom, 1, start, stop)
    if pair:
        sides = [-1.0, 1.0]
    elif upright:
        # The lip belongs to the door, and a door is wider than what stands beside it.
        bordered = [
            panel if seen >= p.flanks else 0.0 for panel, seen in ((reach_above, seen_above), (reach_below, seen_below))
        ]
        sides = [-1.0 if bordered[0] > bordered[1] else 1.0]
    else:
        sides = [1.0]
    result = []
    for side in sides:
        edge, seen, borders = (bottom, seen_below, lower) if side > 0 else (top, seen_above, upper)
        deviation = float(np.abs(borders[full] - np.median(borders[full])).mean()) * cell
        panel = reach_below if side > 0 else reach_above
        if seen < p.flanks or panel * cell < p.panel[upright] or deviation > p.straightness + 0.5 * cell:
            continue
        along = 0.5 * (start + stop) - 0.5
        across = edge - 0.5
        confidence = seen * (1.0 - 0.3 * deviation / p.straightness) * float(full[left:right].mean())
        front = lying.front
        if upright:
            centre = (front.x_of(across), front.y_of(along))
        else:
            centre = (front.x_of(along), front.y_of(across))
        result.append(
            Groove(
                centre,
                length,
                0.5 * width if pair else width,
                upright,
                side if upright else -side,
                min(1.0, max(0.0, confidence)),
            )
        )
    return result


def _plate(inside: NDArray[np.float64], cell: float, p: GroovesParameters) -> tuple[float, float] | None:
    """Level and width of the back of an upright opening: parallel to the front and near behind it.

    None where there is only the side of the furniture, which runs backwards, or the open.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without any depth
        profile = np.nanmedian(inside, axis=1)
    heights = profile[np.isfinite(profile)]
    lag = max(2, round(0.010 / cell))
    if len(heights) <= lag:
        return None
    level = (heights[lag:] + heights[:-lag]) / 2
    even = np.abs(heights[lag:] - heights[:-lag]) < p.plate_slope * lag * cell
    even &= (level < -p.back[0]) & (level > -p.back[1])
    if even.mean() < p.plate_share:
        return None
    middle = float(np.median(level[even]))
    return middle, float((np.abs(heights - middle) < 0.008).sum()) * cell


def _ends_in_the_open(lying: _Lying, where: tuple[int, int, int, int], level: float, panel_above: bool) -> bool:
    """Whether the back of a strip goes on neither behind its other border nor beyond its ends."""
    top, bottom, start, stop = where
    reach, margin = max(2, round(0.010 / lying.cell)), max(1, round(0.008 / lying.cell))
    first = bottom + margin if panel_above else max(0, top - margin - reach)
    beyond = lying.height[first : first + reach, start:stop]
    if np.isfinite(beyond).any() and np.nanmedian(beyond) > level - 0.02:
        return False
    ends = (slice(max(0, start - margin - reach), max(0, start - margin)), slice(stop + margin, stop + margin + reach))
    with np.errstate(invalid="ignore"):
        return all(_share(np.abs(lying.height[top:bottom, end] - level) < 0.01) < 0.5 for end in ends)


def _lip(groove: Groove, p: GroovesParameters) -> HandleOnFront:
    x, y = groove.centre
    grip, beyond = groove.inward * p.grip, -groove.inward * groove.width
    if groove.upright:
        side: Side = "right" if beyond > 0 else "left"
        borders = replace(PanelBorders(), **{side: x + beyond})
        middle, angle = np.array([x + grip, y, -p.lip / 2]), math.pi / 2
    else:
        borders = PanelBorders(top=y + beyond) if beyond > 0 else PanelBorders(bottom=y + beyond)
        middle, angle = np.array([x, y + grip, -p.lip / 2]), 0.0
    return HandleOnFront("edge", middle, angle, p.lip / 2, groove.length, groove.confidence, p.position_std, borders)


def _share(cells: NDArray[np.bool_]) -> float:
    return float(cells.mean()) if cells.size else 0.0


def _run(shown: NDArray[np.bool_], row: int, step: int, start: int, stop: int) -> float:
    """How far the front goes on from a border, in cells: median over the columns."""
    part = shown[:row, start:stop][::-1] if step < 0 else shown[row:, start:stop]
    if not part.size:
        return 0.0
    smooth = cv2.morphologyEx(part.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 1), np.uint8)) > 0
    begun = np.maximum.accumulate(smooth, axis=0)
    ended = begun & ~smooth
    return float(np.median(np.where(ended.any(axis=0), np.argmax(ended, axis=0), len(part))))


def _refined(groove: Groove, relief: Relief, reach: float = 0.018) -> Groove:
    """The lip's border where pixels change from front to opening, with least error: finer than cells."""
    x, y = groove.centre
    half = 0.45 * groove.length
    low, high = (
        ((x - reach, y - half), (x + reach, y + half))
        if groove.upright
        else ((x - half, y - reach), (x + half, y + reach))
    )
    rows, columns = np.nonzero(np.isfinite(relief.height) & relief.near)
    flat = relief.on_level((rows, columns), 0.0)
    inside = (flat > low).all(axis=1) & (flat < high).all(axis=1)
    if inside.sum() < 30:
        return groove
    height = relief.height[rows[inside], columns[inside]]
    noise = relief.noise[rows[inside], columns[inside]]
    shown = np.abs(height) < np.maximum(0.005, 2.5 * noise)
    across = (flat[inside, 0] if groove.upright else flat[inside, 1]) * groove.inward
    order = np.argsort(across, kind="stable")
    # Beyond the border (smaller values) openings, within it the front.
    score = np.cumsum(np.where(shown[order], -1, 1))
    best = int(np.argmax(score))
    border = groove.inward * 0.5 * float(across[order][best] + across[order][min(best + 1, len(order) - 1)])
    centre = (border, y) if groove.upright else (x, border)
    return Groove(centre, groove.length, groove.width, groove.upright, groove.inward, groove.confidence)
