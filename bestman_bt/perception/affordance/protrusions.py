"""Detection of bars and knobs: small objects in front of a panel that is visible around them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.handle import HandleKind
from bestman_bt.perception.affordance.rectified import HeightMap, PanelBorders


@dataclass(frozen=True)
class SurroundLimits:
    """The surroundings of a handle that must be visible.

    Lengths in metres.

    ``ring``: width of the strip around it; ``edge_pixels``: gap between strip and handle, where depth is often missing.
    ``sides``: minimum fraction of a strip that shows the front; ``ends``: minimum fraction beyond an end of a bar that
    lies ``clearance`` farther back. ``hiding``: an object this much nearer to the camera hides the strip.
    ``seen_through``: maximum fraction of a bar through which the background is visible: two knobs are not a bar.
    """

    ring: Annotated[float, "m"] = 0.014
    edge_pixels: Annotated[float, "pixels"] = 2.5
    sides: float = 0.75
    ends: float = 0.5
    clearance: Annotated[float, "m"] = 0.010
    hiding: Annotated[float, "m"] = 0.06
    seen_through: float = 0.12


class HandleSurroundings:
    """The pixels around a candidate from ``low`` to ``high`` (x, y), ``level`` metres in front of its plane."""

    def __init__(
        self, relief: HeightMap, low: NDArray[np.float64], high: NDArray[np.float64], level: float, p: SurroundLimits
    ) -> None:
        self._p = p
        self._margin = p.edge_pixels * relief.pixel_size()
        self._ring = max(p.ring, 3.0 * relief.pixel_size())
        reach = self._margin + self._ring
        # Seen aslant, the place behind the thing is beside it in the image.
        at_level = relief.window(low - reach, high + reach, level)
        behind = relief.window(low - reach, high + reach, 0.0)
        rows, columns = (
            slice(min(a.start, b.start), max(a.stop, b.stop)) for a, b in zip(at_level, behind, strict=True)
        )
        height = relief.height[rows, columns]
        known = np.isfinite(height)
        inside = np.nonzero(known)
        pixels = (inside[0] + rows.start, inside[1] + columns.start)
        around, noise = height[known], relief.noise[rows, columns][known]
        self.flat = relief.on_level(pixels, level)
        self.foot = relief.on_level(pixels, 0.0)
        self.on_front = np.abs(around) < np.maximum(0.006, 3.0 * noise)
        self.behind = around < -np.maximum(0.006, 3.0 * noise)
        self.farther = around < level - np.maximum(p.clearance, 3.0 * noise)
        self.hides = around > level + p.hiding

    def bar(
        self, middle: NDArray[np.float64], along: NDArray[np.float64], length: float, radius: float
    ) -> tuple[float, bool] | None:
        """Return the free fraction of the ring around a bar, and whether one of its ends is hidden.

        None if something touches the bar or the front does not surround it.
        """
        across = np.array([-along[1], along[0]])
        s, t = (self.flat - middle) @ along, (self.flat - middle) @ across
        inner, outer = radius + self._margin, radius + self._margin + self._ring
        beside = np.abs(s) < length / 2
        inside = beside & (np.abs(t) < 0.6 * radius)
        if inside.sum() >= 5 and self.farther[inside].mean() > self._p.seen_through:
            return None
        shares = []
        for sign in (-1.0, 1.0):
            side = beside & (sign * t > inner) & (sign * t < outer) & ~self.hides
            if side.sum() < 5 or self.farther[side].mean() < self._p.sides:
                return None
            share = float(self.on_front[side].mean())
            if share < self._p.sides and not self._foot_on_front(middle, along, sign * across, length, radius):
                return None
            shares.append(max(share, self._p.sides))
        ends = []
        for sign in (-1.0, 1.0):
            beyond = sign * s - length / 2
            end = (np.abs(t) < outer) & (beyond > self._margin) & (beyond < self._margin + self._ring)
            if end.sum() < 3:
                return None
            if self.farther[end].mean() >= self._p.ends:
                ends.append(float(self.farther[end].mean()))
            elif self.hides[end].mean() < self._p.ends:
                return None
        return (float(np.mean(shares + ends)), len(ends) < 2) if ends else None

    def hidden(self, middle: NDArray[np.float64], along: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
        """Return the occluded positions along a bar, metres from its middle."""
        across = np.array([-along[1], along[0]])
        hides = self.hides & (np.abs((self.flat - middle) @ across) < radius + self._margin)
        where: NDArray[np.float64] = (self.flat[hides] - middle) @ along
        return where

    def knob(self, centre: NDArray[np.float64], radius: float) -> float | None:
        """Return the free fraction of the ring around a knob, or None; one quadrant may be occupied or unseen."""
        around = self.flat - centre
        distance = np.linalg.norm(around, axis=1)
        inner, outer = radius + self._margin, radius + self._margin + self._ring
        ring = (distance > inner) & (distance < outer) & ~self.hides
        if ring.sum() < 12:
            return None
        angles = np.arctan2(around[ring, 1], around[ring, 0])
        quarter = np.floor((angles + 1.25 * math.pi) / (math.pi / 2)).astype(int) % 4
        on_front, below = self.on_front[ring], quarter == 1
        # What a thing stands on rises towards it.
        if not below.any() or np.mean((on_front | self.behind[ring])[below]) < 0.9:
            return None
        shares = sorted(float(on_front[quarter == i].mean()) if (quarter == i).any() else 0.0 for i in range(4))
        return float(np.mean(shares[1:])) if shares[1] >= self._p.sides else None

    def _foot_on_front(
        self,
        middle: NDArray[np.float64],
        along: NDArray[np.float64],
        outwards: NDArray[np.float64],
        length: float,
        radius: float,
    ) -> bool:
        """Return whether the front is seen straight behind the bar, or next to there: else it is a board's edge.

        Seen aslant, a bar near the border of its panel has something else beside it in the image.
        """
        s, t = (self.foot - middle) @ along, (self.foot - middle) @ outwards
        strip = (np.abs(s) < length / 2) & (t > -0.5 * radius) & (t < radius + 0.014) & self.farther
        return bool(strip.sum() >= 5 and self.on_front[strip].mean() >= 0.6)


NEAR_BORDER = 0.06
"""Distance from its panel's border within which the end of an edge is assumed to reach it, metres."""


@dataclass(frozen=True, eq=False)
class HandleOnFront:
    """A handle in the frame of its front. ``centre``: (3,) metres, of the gripped part. ``angle``: of its axis from the
    front's x, radians.

    Lengths in metres; see ``bestman_bt.messages.Handle``. ``borders``: borders of its panel, as far as the handle shows
    them. ``end_hidden``: whether one end is hidden; ``centre`` and ``length`` are then those of the visible part.
    """

    kind: HandleKind
    centre: NDArray[np.float64]
    angle: float
    radius: float
    length: float
    confidence: float
    position_std: float
    borders: PanelBorders = field(default_factory=PanelBorders)
    end_hidden: bool = False

    @property
    def upright(self) -> bool:
        """Return whether its axis is nearer to the vertical."""
        return self.kind != "knob" and abs(math.sin(self.angle)) > math.sqrt(0.5)

    @property
    def rectangle(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest x and y, (2,) metres each."""
        half = np.abs([math.cos(self.angle), math.sin(self.angle)]) * self.length / 2
        half = np.maximum(half, self.radius)
        return self.centre[:2] - half, self.centre[:2] + half

    def completed(self, borders: PanelBorders, position_std: float) -> HandleOnFront:
        """Return the handle, extended by its hidden part where the visible part determines it.

        A recessed edge that ends near a border of its panel is extended to it and, if its other end is hidden, to the
        opposite border; a horizontal handle with a hidden end is centred on its panel where possible.
        """
        if self.kind == "edge":
            along = self._up_to_borders(borders)
            if along is not None:
                centre = self.centre.copy()
                centre[1 if self.upright else 0] = 0.5 * (along[0] + along[1])
                return replace(self, centre=centre, length=along[1] - along[0])
        if not self.end_hidden or self.upright or borders.left is None or borders.right is None:
            return self
        x = 0.5 * (borders.left + borders.right)
        half = abs(float(self.centre[0]) - x) + 0.5 * self.length
        if half > 0.5 * (borders.right - borders.left) or half > 1.2 * self.length:
            return self
        centre = np.array([x, self.centre[1] + (x - self.centre[0]) * math.tan(self.angle), self.centre[2]])
        return replace(self, centre=centre, length=2 * half, position_std=position_std)

    def _up_to_borders(self, borders: PanelBorders) -> tuple[float, float] | None:
        """Return the extent of an edge that comes near a border of its panel, else None."""
        first, last = (borders.bottom, borders.top) if self.upright else (borders.left, borders.right)
        middle = float(self.centre[1 if self.upright else 0])
        low, high = middle - self.length / 2, middle + self.length / 2
        near_first = first is not None and abs(low - first) < NEAR_BORDER
        near_last = last is not None and abs(high - last) < NEAR_BORDER
        if not (near_first or near_last):
            return None
        low = first if first is not None and (near_first or self.end_hidden) else low
        high = last if last is not None and (near_last or self.end_hidden) else high
        return low, high


# Mean distance of the seen half of a cylinder from its axis, in radii, where pixels fall evenly on its width.
_SEEN_DISTANCE = math.pi / 4
# Median height of the seen half of a ball above its centre, in radii; flat heads come near it.
_SEEN_KNOB = 0.66

Pixels = tuple[NDArray[np.intp], NDArray[np.intp]]


@dataclass(frozen=True)
class ProtrusionSearch:
    """Finds bars and knobs in front of a plane.

    Lengths in metres.

    ``low``, ``high``: heights above the front at which bars and knobs are searched. ``layers``: heights that are
    searched separately, so that an object close to a handle does not hide it. ``significance``: minimum height of a
    protruding pixel, in multiples of the depth noise. ``min_pixels``: pixels with depth of a handle. ``gap``,
    ``bar_gap``: maximum distance of neighbouring pixels of one handle; larger along a bar, since depth is often missing
    there. ``bar_length``, ``bar_width``: minimum and maximum of bars. ``bar_slenderness``: minimum ratio of length to
    width, including the visible parts of the posts; ``post_reach``: maximum width including them. ``level_spread``:
    maximum spread of the depths of one bar, besides the noise. ``max_slope``: of a bar against the front, radians.
    ``min_filled``: minimum visible fraction of a bar's length. ``finger_room``: minimum distance between a bar and the
    front. ``knob_size``: minimum and maximum extent of knobs including the visible parts of their stems;
    ``knob_slenderness``: maximum ratio of length to width; ``knob_radius``: of the head. ``knob_height``: minimum
    height of a knob; ``knob_standoff``: minimum height of its middle, in radii, so that fingers have room behind it.
    """

    low: Annotated[float, "m"] = 0.008
    high: Annotated[float, "m"] = 0.085
    layers: Annotated[tuple[tuple[float, float], ...], "m"] = ((0.008, 0.040), (0.024, 0.064), (0.044, 0.085))
    significance: float = 3.0
    min_pixels: Annotated[int, "pixels"] = 8
    gap: Annotated[float, "m"] = 0.012
    bar_gap: Annotated[float, "m"] = 0.045
    bar_length: Annotated[tuple[float, float], "m"] = (0.06, 0.85)
    bar_width: Annotated[tuple[float, float], "m"] = (0.003, 0.032)
    bar_slenderness: float = 2.5
    post_reach: Annotated[float, "m"] = 0.075
    knob_size: Annotated[tuple[float, float], "m"] = (0.009, 0.075)
    knob_radius: Annotated[tuple[float, float], "m"] = (0.006, 0.026)
    knob_slenderness: float = 2.4
    knob_height: Annotated[float, "m"] = 0.019
    knob_standoff: float = 0.7
    level_spread: Annotated[float, "m"] = 0.012
    max_slope: Annotated[float, "rad"] = math.radians(10.0)
    min_filled: float = 0.75
    finger_room: Annotated[float, "m"] = 0.008
    surround: SurroundLimits = field(default_factory=SurroundLimits)

    def find(self, relief: HeightMap) -> list[HandleOnFront]:
        """Return all bars and knobs in front of one plane; duplicates are possible."""
        with np.errstate(invalid="ignore"):
            limit = np.maximum(self.low, self.significance * relief.noise)
            before = relief.near & (relief.height > limit) & (relief.height < self.high)
        crowded = cv2.boxFilter(before.astype(np.uint8), cv2.CV_32F, (5, 5), normalize=False) >= 2
        rows, columns = np.nonzero(before & crowded)
        pixels: Pixels = (rows, columns)
        if len(pixels[0]) < self.min_pixels:
            return []
        flat, height = relief.on_level(pixels, 0.0), relief.height[pixels]
        found: list[HandleOnFront] = []
        free = np.ones(len(height), dtype=bool)
        for low, high in ((self.low, self.high), *self.layers):
            layer = np.flatnonzero(free & (height > low) & (height < high))
            if len(layer) < self.min_pixels:
                continue
            for group in self._groups(flat[layer], max(0.003, relief.pixel_size())):
                members = layer[group]
                one = self._judge(relief, (pixels[0][members], pixels[1][members]))
                if one is not None:
                    found.append(one)
                    free[members] = False
        return found

    def _groups(self, flat: NDArray[np.float64], cell: float) -> list[NDArray[np.intp]]:
        """Group points (N, 2), metres, that lie near each other in all directions, or along a level or an upright bar.

        The cells lie in the front's plane, in which a bar is level or upright at any angle of the camera.
        """
        places = np.floor((flat - flat.min(axis=0)) / cell).astype(np.intp)
        near, far = 2 * math.ceil(self.gap / cell / 2) + 1, 2 * math.ceil(self.bar_gap / cell / 2) + 1
        places += far
        mask = np.zeros(places.max(axis=0) + far + 1, dtype=np.uint8)
        mask[places[:, 0], places[:, 1]] = 1
        groups: dict[bytes, NDArray[np.intp]] = {}
        for size in ((near, near), (far, 3), (3, far)):
            closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones(size, np.uint8))
            count, labels = cv2.connectedComponents(closed, connectivity=8)
            label_of = labels[places[:, 0], places[:, 1]]
            order = np.argsort(label_of, kind="stable")
            borders = np.searchsorted(label_of[order], np.arange(1, count + 1))
            for first, last in pairwise(borders):
                if last - first >= self.min_pixels:
                    groups.setdefault(order[first:last].tobytes(), order[first:last])
        return list(groups.values())

    def _judge(self, relief: HeightMap, pixels: Pixels) -> HandleOnFront | None:
        pixel = relief.pixel_size()
        if len(pixels[0]) * pixel**2 > self.bar_length[1] * self.post_reach:
            return None
        heights = relief.height[pixels]
        level, sigma = float(np.median(heights)), float(np.median(relief.noise[pixels]))
        # Posts are left out.
        top = np.abs(heights - level) < self.level_spread + 3.0 * sigma
        if top.sum() < self.min_pixels or top.mean() < 0.4:
            return None
        flat = relief.on_level((pixels[0][top], pixels[1][top]), level)
        low, high = flat.min(axis=0), flat.max(axis=0)
        if (high - low).max() > self.bar_length[1]:
            return None
        centre = flat.mean(axis=0)
        axes = _axes(flat - centre)
        length, width = (_extent((flat - centre) @ axis) + 0.5 * pixel for axis in axes)
        like_bar = length >= self.bar_slenderness * width and length >= self.bar_length[0] and width < self.post_reach
        like_knob = (
            length <= self.knob_size[1] and width >= self.knob_size[0] and length < self.knob_slenderness * width
        )
        if not (like_bar or like_knob):
            return None
        members = self._members(relief, low, high, level, sigma)
        if len(members[0]) < self.min_pixels:
            return None
        return (self._bar if like_bar else self._knob)(relief, members, sigma)

    def _members(
        self, relief: HeightMap, low: NDArray[np.float64], high: NDArray[np.float64], level: float, sigma: float
    ) -> Pixels:
        """Return all pixels of a thing: halfway between the front and it is the limit that errs least."""
        pixel = relief.pixel_size()
        rows, columns = relief.window(low - pixel, high + pixel, level)
        height = relief.height[rows, columns]
        with np.errstate(invalid="ignore"):
            chosen = (height > 0.5 * level) & (np.abs(height - level) < self.level_spread + 3.0 * sigma)
        inside = np.nonzero(chosen)
        pixels = (inside[0] + rows.start, inside[1] + columns.start)
        flat = relief.on_level(pixels, level)
        within = ((flat > low - pixel) & (flat < high + pixel)).all(axis=1)
        return pixels[0][within], pixels[1][within]

    def _bar(self, relief: HeightMap, pixels: Pixels, sigma: float) -> HandleOnFront | None:
        heights = relief.height[pixels]
        seen_level = level = float(heights.mean())
        for _ in range(2):
            flat = relief.on_level(pixels, level)
            centre, along, keep = _line(flat)
            s, t = (flat - centre) @ along, (flat - centre) @ np.array([-along[1], along[0]])
            to_eye = relief.eye - np.array([*centre, level])
            to_eye -= np.array([*along, 0.0]) * (to_eye[:2] @ along)
            facing = float(to_eye[2] / np.linalg.norm(to_eye))
            # Pixels fall evenly on the width; its standard deviation does not mind those that dropped out.
            radius = max(0.003, facing * math.sqrt(3.0) * float(np.std(t[keep])))
            level = seen_level - _SEEN_DISTANCE * radius * facing
        if level - radius < self.finger_room:
            return None
        low, high = float(s[keep].min()), float(s[keep].max())
        length = high - low
        if not (
            self.bar_width[0] <= 2 * radius <= self.bar_width[1] and self.bar_length[0] <= length <= self.bar_length[1]
        ):
            return None
        slope = float(np.polyfit(s[keep], heights[keep], 1)[0])
        slope_std = sigma / (math.sqrt(float(keep.sum())) * float(np.std(s[keep])))
        if abs(math.atan(slope)) > self.max_slope + 2 * slope_std:
            return None
        middle = centre + 0.5 * (low + high) * along
        surround = HandleSurroundings(relief, flat[keep].min(axis=0), flat[keep].max(axis=0), level, self.surround)
        bins = max(3, int(length / max(0.012, 2.5 * relief.pixel_size())))
        where = np.concatenate([s[keep], surround.hidden(middle, along, radius) + 0.5 * (low + high)])
        where = where[(where >= low) & (where <= high)]
        filled = np.bincount(np.minimum(((where - low) / length * bins).astype(int), bins - 1), minlength=bins) > 0
        if filled.mean() < self.min_filled:
            return None
        free = surround.bar(middle, along, length, radius)
        if free is None:
            return None
        count = float(keep.sum())
        lateral = radius / math.sqrt(count) + 0.3 * relief.pixel_size()
        std = math.sqrt((sigma / math.sqrt(count)) ** 2 + lateral**2 + 0.0015**2)
        confidence = min(1.0, free[0] * float(filled.mean()) * (1.0 - math.exp(-count / 12.0)))
        angle = math.atan2(along[1], along[0])
        centre_of_bar = np.array([*middle, level])
        return HandleOnFront("bar", centre_of_bar, angle, radius, length, confidence, std, end_hidden=free[1])

    def _knob(self, relief: HeightMap, pixels: Pixels, sigma: float) -> HandleOnFront | None:
        heights = relief.height[pixels]
        level = float(np.median(heights))
        if level < self.knob_height:
            return None
        flat = relief.on_level(pixels, level)
        # Seen aslant, the side of a knob lengthens it: its breadth tells its size.
        breadth = float(np.ptp((flat - flat.mean(axis=0)) @ _axes(flat - flat.mean(axis=0))[1]))
        radius = 0.5 * breadth + 0.5 * relief.pixel_size()
        if not self.knob_radius[0] <= radius <= self.knob_radius[1]:
            return None
        low, high = flat.min(axis=0), flat.max(axis=0)
        share = HandleSurroundings(relief, low, high, level, self.surround).knob(0.5 * (low + high), radius)
        if share is None:
            return None
        level -= _SEEN_KNOB * radius
        if level < self.knob_standoff * radius:
            return None
        flat = relief.on_level(pixels, level)
        centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
        std = math.sqrt((sigma / math.sqrt(len(heights))) ** 2 + 0.003**2)
        confidence = min(1.0, share * (1.0 - math.exp(-len(heights) / 10.0)))
        return HandleOnFront("knob", np.array([*centre, level]), 0.0, radius, 2 * radius, confidence, std)


def _line(flat: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return a line through (N, 2) points by total least squares; posts and outliers far from it are ignored."""
    keep = np.ones(len(flat), dtype=bool)
    for _ in range(3):
        centre = flat[keep].mean(axis=0)
        along = _axes(flat[keep] - centre)[0]
        off = np.abs((flat - centre) @ np.array([-along[1], along[0]]))
        keep = off < 3.0 * max(0.001, float(np.median(off[keep])) * 1.48)
    return centre, along if along[int(np.argmax(np.abs(along)))] > 0 else -along, keep


def _axes(offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the principal axes of (N, 2) offsets, the longest first, as rows."""
    axes: NDArray[np.float64] = np.linalg.eigh(offsets.T @ offsets)[1].T[::-1]
    return axes


def _extent(values: NDArray[np.float64]) -> float:
    return float(np.percentile(values, 98) - np.percentile(values, 2))
