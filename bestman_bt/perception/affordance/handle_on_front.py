"""A handle in the frame of its front, before its panel is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.handle import HandleKind
from bestman_bt.perception.affordance.panel_borders import PanelBorders

NEAR_BORDER = 0.06
"""Metres from its panel's border to the end of an edge that is taken to go up to it."""


@dataclass(frozen=True, eq=False)
class HandleOnFront:
    """``centre``: (3,) metres, of what is gripped. ``angle``: of its axis against the front's x, radians.

    Lengths in metres; see bestman_bt.messages.Handle. ``borders``: of its panel, as far as the handle itself tells.
    ``end_hidden``: something is before an end of it, so that ``centre`` and ``length`` are of the part that is seen.
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
        """Whether its axis is nearer to the vertical."""
        return self.kind != "knob" and abs(math.sin(self.angle)) > math.sqrt(0.5)

    @property
    def rectangle(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest x and y, (2,) metres each."""
        half = np.abs([math.cos(self.angle), math.sin(self.angle)]) * self.length / 2
        half = np.maximum(half, self.radius)
        return self.centre[:2] - half, self.centre[:2] + half

    def completed(self, borders: PanelBorders, position_std: float) -> HandleOnFront:
        """The handle, supplemented where the part that is seen tells the whole.

        A recessed edge that comes near a border of its panel goes up to it, and, where its other end is hidden, up to
        the other one; a level handle with a hidden end sits in the middle of its panel, where it can.
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
        """From where to where an edge goes that comes near a border of its panel; else None."""
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
