"""A handle in the frame of its front, before its panel is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.handle import HandleKind
from bestman_bt.perception.affordance.panel_borders import PanelBorders


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

        A recessed edge along most of a border goes along all of it; a level handle with a hidden end sits in the middle
        of its panel, where it can.
        """
        first, last = (borders.bottom, borders.top) if self.upright else (borders.left, borders.right)
        if self.kind == "edge" and first is not None and last is not None and self.length > 0.75 * (last - first):
            middle = np.array([self.centre[0], 0.5 * (first + last), self.centre[2]])
            if not self.upright:
                middle = np.array([0.5 * (first + last), *self.centre[1:]])
            return replace(self, centre=middle, length=last - first)
        if not self.end_hidden or self.upright or borders.left is None or borders.right is None:
            return self
        x = 0.5 * (borders.left + borders.right)
        half = abs(float(self.centre[0]) - x) + 0.5 * self.length
        if half > 0.5 * (borders.right - borders.left) or half > 1.2 * self.length:
            return self
        centre = np.array([x, self.centre[1] + (x - self.centre[0]) * math.tan(self.angle), self.centre[2]])
        return replace(self, centre=centre, length=2 * half, position_std=position_std)
