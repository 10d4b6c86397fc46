"""How a panel is likely to open, by its form and by where its handle is.

Furniture makers' rules: a drawer is pulled in its middle; a door is taken far from its hinge; a tall panel with a bar
along its top folds down.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.handle import HandleKind, HingeSide, JointKind
from bestman_bt.perception.affordance.panel_borders import PanelBorders


@dataclass(frozen=True)
class JointRules:
    """Tell how a panel opens from its form and the place of its handle.

    ``centred``: a handle is amid a panel where it is off by less than this share of the half width.

    ``drawer_height``: metres, of the highest drawers. ``folding_place``: share of the half height beyond which the
    handle of a folding panel is; ``folding_slenderness``: most height by width of one. ``leaf``: metres, half the
    thickness of doors: their hinges lie that far behind the front. ``hollow_leaf``: the same of doors with a recess.
    """

    centred: float = 0.2
    drawer_height: Annotated[float, "m"] = 0.55
    folding_place: float = 0.6
    folding_slenderness: float = 1.8
    leaf: Annotated[float, "m"] = 0.010
    hollow_leaf: Annotated[float, "m"] = 0.030

    def suggest(
        self,
        kind: HandleKind,
        upright: bool,
        centre: NDArray[np.float64],
        borders: PanelBorders,
        seen: tuple[NDArray[np.float64], NDArray[np.float64]],
    ) -> JointSuggestion:
        """For a handle at ``centre`` (x, y, metres in the frame of its front); ``upright``: its axis is vertical.

        ``seen``: lowest and highest x and y of the front that were seen; they stand in for borders that were not.
        """
        low, high = seen
        left, right = _first(borders.left, low[0]), _first(borders.right, high[0])
        bottom, top = _first(borders.bottom, low[1]), _first(borders.top, high[1])
        width, height = right - left, top - bottom
        across, along = (2 * centre[0] - left - right) / width, (2 * centre[1] - bottom - top) / height
        sure = 0.9 if borders.rectangle is not None else 0.65
        if abs(across) >= self.centred:
            # Beside the middle: a door, hinged on the other side.
            return JointSuggestion("revolute", sure, "left" if across > 0 else "right")
        if upright and kind != "knob":
            return JointSuggestion("revolute", 0.6)
        if height > self.drawer_height:
            if abs(along) >= self.folding_place and height < self.folding_slenderness * width:
                return JointSuggestion("revolute", sure, "bottom" if along > 0 else "top")
            # A bar may take so much of a narrow door's width that it is hardly off its middle.
            return JointSuggestion("revolute", 0.55, "left" if across > 0 else "right")
        return JointSuggestion("prismatic", sure if height < 0.8 * self.drawer_height else 0.6)

    def hinge_line(
        self, side: HingeSide, kind: HandleKind, borders: PanelBorders
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """A point (3,) on the hinge's axis and its direction (3,), in the front's frame.

        None where its border is unknown.

        A positive turn about the direction opens.
        """
        at = getattr(borders, side)
        if at is None:
            return None
        first, second = (borders.bottom, borders.top) if side in ("left", "right") else (borders.left, borders.right)
        middle = 0.0 if first is None or second is None else 0.5 * (first + second)
        behind = -self.hollow_leaf if kind == "edge" else -self.leaf
        if side in ("left", "right"):
            return np.array([at, middle, behind]), np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])
        return np.array([middle, at, behind]), np.array([1.0 if side == "bottom" else -1.0, 0.0, 0.0])


@dataclass(frozen=True)
class JointSuggestion:
    """``confidence``: 0.5 (a guess) to 1. ``hinge_side``: as seen from the front, of a revolute joint."""

    joint: JointKind
    confidence: float
    hinge_side: HingeSide | None = None


def _first(border: float | None, otherwise: float) -> float:
    return float(otherwise) if border is None else border
