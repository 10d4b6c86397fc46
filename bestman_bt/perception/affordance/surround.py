"""What is seen around a thing that stands out of a front: the front, something farther back, or what it stands on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.rectified import HeightMap


@dataclass(frozen=True)
class SurroundLimits:
    """What must be visible around a handle.

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


class Surround:
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
