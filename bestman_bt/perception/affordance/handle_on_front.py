"""A handle in the frame of its front, before its panel is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.handle import HandleKind
from bestman_bt.perception.affordance.panel_borders import PanelBorders


@dataclass(frozen=True, eq=False)
class HandleOnFront:
    """``centre``: (3,) metres, of what is gripped. ``angle``: of its axis against the front's x, radians.

    Lengths in metres; see bestman_bt.messages.Handle. ``borders``: of its panel, as far as the handle itself tells.
    """

    kind: HandleKind
    centre: NDArray[np.float64]
    angle: float
    radius: float
    length: float
    confidence: float
    position_std: float
    borders: PanelBorders = field(default_factory=PanelBorders)

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
