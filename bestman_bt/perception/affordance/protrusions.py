"""Bars and knobs: small things before a front, with the front to be seen around them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.handle_on_front import HandleOnFront
from bestman_bt.perception.affordance.relief import Relief

# Mean distance of the seen half of a cylinder from its axis, in radii, where pixels fall evenly on its width.
_SEEN_DISTANCE = math.pi / 4
# Median height of the seen half of a ball above its centre, in radii; flat heads come near it.
_SEEN_KNOB = 0.66


@dataclass(frozen=True)
class ProtrusionsParameters:
    """Lengths in metres.

    ``low``, ``high``: heights before the front at which bars and knobs are seen. ``significance``: a pixel stands out
    where it is that many times the noise before the front. ``min_pixels``: with depth, of one bar or knob.
    ``bar_length``, ``bar_width``: of bars, least and most; ``bar_slenderness``: least length by width.
    ``knob_size``: least and most extent of knobs; ``knob_height``: that a knob at least stands out, else fingers find
    no room behind it. ``level_spread``: depths of one bar differ by that at most, besides the noise.
    ``ring``: width of the strip around, in which the front must be seen. ``sides``: least share of the strip beside a
    bar or around a knob that shows the front (half of it on one side of a bar, where its panel may end).
    ``ends``: least share beyond either end that lies ``clearance`` farther back: what stands on something touches it.
    ``max_slope``: of a bar against the front, radians. ``min_filled``: share of a bar's length on which it is seen.
    """

    low: float = 0.008
    high: float = 0.085
    significance: float = 3.0
    min_pixels: int = 8
    bar_length: tuple[float, float] = (0.05, 0.85)
    bar_width: tuple[float, float] = (0.003, 0.040)
    bar_slenderness: float = 2.5
    knob_size: tuple[float, float] = (0.012, 0.060)
    knob_height: float = 0.019
    level_spread: float = 0.012
    ring: float = 0.014
    sides: float = 0.75
    ends: float = 0.5
    clearance: float = 0.010
    max_slope: float = math.radians(10.0)
    min_filled: float = 0.7


def find_protrusions(relief: Relief, parameters: ProtrusionsParameters) -> list[HandleOnFront]:
    """All bars and knobs before one front."""
    p = parameters
    with np.errstate(invalid="ignore"):
        before = (
            relief.near & (relief.height > np.maximum(p.low, p.significance * relief.noise)) & (relief.height < p.high)
        )
    seeds = before.astype(np.uint8)
    # Depth drops out along edges: a thin bar is a loose row of pixels.
    crowded = cv2.boxFilter(seeds, cv2.CV_32F, (5, 5), normalize=False, borderType=cv2.BORDER_CONSTANT) >= 3
    closed = cv2.morphologyEx((before & crowded).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
    found = []
    for label in range(1, count):
        left, top, width, height, area = (int(value) for value in stats[label])
        if area < p.min_pixels:
            continue
        if left <= 1 or top <= 1 or left + width >= closed.shape[1] - 1 or top + height >= closed.shape[0] - 1:
            continue
        box = slice(max(0, top - 40), top + height + 40), slice(max(0, left - 40), left + width + 40)
        protrusion = _judge(relief, box, labels[box] == label, p)
        if protrusion is not None:
            found.append(protrusion)
    return found


def _judge(
    relief: Relief, box: tuple[slice, slice], component: NDArray[np.bool_], p: ProtrusionsParameters
) -> HandleOnFront | None:
    height, noise = relief.height[box], relief.noise[box]
    grown = cv2.dilate(component.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    known = grown & np.isfinite(height)
    with np.errstate(invalid="ignore"):
        member = component & (height > p.low) & (height < p.high)
        if member.sum() < p.min_pixels:
            return None
        level = float(np.median(height[member]))
        sigma = float(np.median(noise[member]))
        # Halfway between front and bar is the boundary that errs least.
        member = known & (height > 0.5 * level) & (np.abs(height - level) < p.level_spread + 3.0 * sigma)
    if member.sum() < p.min_pixels:
        return None
    offset = np.array([box[0].start, box[1].start])
    pixels = tuple(index + shift for index, shift in zip(np.nonzero(member), offset, strict=True))
    heights = height[member]
    level = float(heights.mean())
    flat = relief.on_level(pixels, level)
    centre = flat.mean(axis=0)
    _, _, axes = np.linalg.svd(flat - centre, full_matrices=False)
    along, across = axes[0], np.array([-axes[0][1], axes[0][0]])
    length, width = _extent((flat - centre) @ along), _extent((flat - centre) @ across)
    pixel = relief.pixel_size()
    length, width = length + 0.5 * pixel, width + 0.5 * pixel
    surround = _Surround(relief, box, component, level, p)
    if length >= p.bar_slenderness * width and p.bar_length[0] <= length <= p.bar_length[1]:
        return _bar(relief, pixels, heights, sigma, surround, p)
    if max(length, width) <= p.knob_size[1] and min(length, width) >= p.knob_size[0] and length < 2.0 * width:
        return _knob(relief, pixels, heights, sigma, surround, p)
    return None


def _bar(relief, pixels, heights, sigma, surround, p) -> HandleOnFront | None:  # type: ignore[no-untyped-def]
    level = float(heights.mean())
    radius = 0.006
    for _ in range(3):
        flat = relief.on_level(pixels, level - 0.0)
        centre, along = _line(flat)
        across = np.array([-along[1], along[0]])
        s, t = (flat - centre) @ along, (flat - centre) @ across
        to_eye = relief.eye - np.array([*centre, level])
        to_eye -= np.array([*along, 0.0]) * (to_eye[:2] @ along)
        facing = float(to_eye[2] / np.linalg.norm(to_eye))
        radius = max(0.003, facing * math.sqrt(3.0) * float(np.std(t)))
        level = float(heights.mean()) - _SEEN_DISTANCE * radius * facing
    if not p.bar_width[0] <= 2 * radius <= p.bar_width[1]:
        return None
    low, high = float(s.min()), float(s.max())
    length = high - low
    slope = np.polyfit(s, heights, 1)[0]
    slope_std = sigma / (math.sqrt(len(s)) * float(np.std(s)))
    if abs(math.atan(slope)) > p.max_slope + 2 * slope_std:
        return None
    bins = max(3, int(length / max(0.012, 2.5 * relief.pixel_size())))
    filled = np.bincount(np.minimum(((s - low) / length * bins).astype(int), bins - 1), minlength=bins) > 0
    if filled.mean() < p.min_filled:
        return None
    middle = centre + 0.5 * (low + high) * along
    share = surround.bar(middle, along, length)
    if share is None:
        return None
    angle = math.atan2(along[1], along[0])
    lateral = radius / math.sqrt(len(s)) + 0.3 * relief.pixel_size()
    std = math.sqrt((sigma / math.sqrt(len(s))) ** 2 + lateral**2 + 0.0015**2)
    confidence = min(1.0, share * float(filled.mean()) * (1.0 - math.exp(-len(s) / 12.0)))
    return HandleOnFront("bar", np.array([*middle, level]), angle, radius, length, confidence, std)


def _knob(relief, pixels, heights, sigma, surround, p) -> HandleOnFront | None:  # type: ignore[no-untyped-def]
    level = float(np.median(heights))
    if level < p.knob_height:
        return None
    share = surround.knob()
    if share is None:
        return None
    flat = relief.on_level(pixels, level)
    radius = 0.25 * (float(np.ptp(flat, axis=0).sum()) + relief.pixel_size())
    level -= _SEEN_KNOB * radius
    flat = relief.on_level(pixels, level)
    centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    std = math.sqrt((sigma / math.sqrt(len(heights))) ** 2 + 0.003**2)
    confidence = min(1.0, share * (1.0 - math.exp(-len(heights) / 10.0)))
    return HandleOnFront("knob", np.array([*centre, level]), 0.0, radius, 2 * radius, confidence, std)


class _Surround:
    """Whether the front is seen around a component."""

    def __init__(
        self,
        relief: Relief,
        box: tuple[slice, slice],
        component: NDArray[np.bool_],
        level: float,
        p: ProtrusionsParameters,
    ) -> None:
        self._p = p
        reach = 3 + max(3, round(p.ring / relief.pixel_size()))
        inner = cv2.dilate(component.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        outer = cv2.dilate(component.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) > 0
        height, noise = relief.height[box], relief.noise[box]
        ring = outer & ~inner & np.isfinite(height)
        rows, columns = np.nonzero(ring)
        self.flat = relief.on_level((rows + box[0].start, columns + box[1].start), level)
        around = height[ring]
        self.on_front = np.abs(around) < np.maximum(0.006, 3.0 * noise[ring])
        self.farther = around < level - np.maximum(p.clearance, 3.0 * noise[ring])
        self.hiding = around > level + 0.03

    def bar(self, middle: NDArray[np.float64], along: NDArray[np.float64], length: float) -> float | None:
        """The share of the ring that shows the front; None where that is not enough, or where something touches."""
        s = (self.flat - middle) @ along
        t = (self.flat - middle) @ np.array([-along[1], along[0]])
        beside = np.abs(s) < length / 2
        shares = []
        for side in (beside & (t > 0), beside & (t < 0)):
            if side.sum() < 5 or self.farther[side].mean() < self._p.sides:
                return None
            shares.append(float(self.on_front[side].mean()))
        if max(shares) < self._p.sides or min(shares) < 0.5 * self._p.sides:
            return None
        free = 0
        for end in (~beside & (s > 0), ~beside & (s < 0)):
            if end.sum() >= 3 and self.farther[end].mean() >= self._p.ends:
                free += 1
                shares.append(float(self.farther[end].mean()))
            elif end.sum() < 3 or self.hiding[end].mean() < self._p.ends:
                return None
        return float(np.mean(shares)) if free else None

    def knob(self) -> float | None:
        """As for bars."""
        if len(self.flat) < 12:
            return None
        around = self.flat - self.flat.mean(axis=0)
        # A knob may be so near to a border that one quarter shows what lies beyond.
        quarter = ((np.arctan2(around[:, 1], around[:, 0]) + math.pi) / (math.pi / 2)).astype(int) % 4
        shares = [float(self.on_front[quarter == i].mean()) if (quarter == i).any() else 0.0 for i in range(4)]
        clear = float(self.farther.mean()) >= self._p.sides
        return float(np.mean(shares)) if clear and sorted(shares)[1] >= self._p.sides else None


def _line(flat: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A line through (N, 2) points by total least squares; far ones are left out once."""
    keep = np.ones(len(flat), dtype=bool)
    for _ in range(3):
        centre = flat[keep].mean(axis=0)
        along = np.linalg.svd(flat[keep] - centre, full_matrices=False)[2][0]
        off = np.abs((flat - centre) @ np.array([-along[1], along[0]]))
        keep = off < 3.0 * max(0.001, float(np.median(off[keep])) * 1.48)
    return centre, along if along[int(np.argmax(np.abs(along)))] > 0 else -along


def _extent(values: NDArray[np.float64]) -> float:
    return float(np.percentile(values, 98) - np.percentile(values, 2))
