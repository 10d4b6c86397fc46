"""How a panel is likely to open, by its form and by where its handle is.

Furniture makers' rules: a drawer is pulled in its middle; a door is taken far from its hinge; a tall panel with a bar
along its top folds down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.handle import HandleKind, HingeSide, JointKind
from bestman_bt.perception.affordance.panel_borders import PanelBorders


@dataclass(frozen=True)
class JointSuggestionParameters:
    """``centred``: a handle is amid a panel where it is off by less than this share of the half width.

    ``drawer_height``: metres, of the highest drawers. ``near``: metres from a border, where the others are not seen.
    ``leaf``: metres, half the thickness of doors: their hinges lie that far behind the front.
    """

    centred: float = 0.2
    drawer_height: float = 0.55
    near: float = 0.12
    leaf: float = 0.010


@dataclass(frozen=True)
class JointSuggestion:
    """``confidence``: 0.5 (a guess) to 1. ``hinge_side``: as seen from the front, of a revolute joint."""

    joint: JointKind
    confidence: float
    hinge_side: HingeSide | None = None


def suggest_joint(
    kind: HandleKind,
    upright: bool,
    centre: NDArray[np.float64],
    borders: PanelBorders,
    parameters: JointSuggestionParameters,
) -> JointSuggestion:
    """For a handle at ``centre`` (x, y, metres in the frame of its front); ``upright``: its axis is vertical."""
    p = parameters
    across = _place(float(centre[0]), borders.left, borders.right, p)
    along = _place(float(centre[1]), borders.bottom, borders.top, p)
    height = None if borders.top is None or borders.bottom is None else borders.top - borders.bottom
    sure = 0.9 if borders.rectangle is not None else 0.7
    if across is not None and abs(across) >= p.centred:
        # Beside the middle: a door, hinged on the other side.
        return JointSuggestion("revolute", sure, "left" if across > 0 else "right")
    if upright and kind != "knob":
        return JointSuggestion("revolute", 0.6)
    if height is not None and height > p.drawer_height and along is not None and abs(along) >= p.centred:
        return JointSuggestion("revolute", sure, "bottom" if along > 0 else "top")
    if height is None:
        return JointSuggestion("prismatic", 0.6)
    return JointSuggestion("prismatic", sure if height < 0.8 * p.drawer_height else 0.7)


def hinge_line(
    side: HingeSide, borders: PanelBorders, p: JointSuggestionParameters
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """A point (3,) on the hinge's axis and its direction (3,), in the front's frame; None where its border is unknown.

    A positive turn about the direction opens.
    """
    at = getattr(borders, side)
    if at is None:
        return None
    first, second = (borders.bottom, borders.top) if side in ("left", "right") else (borders.left, borders.right)
    middle = 0.0 if first is None or second is None else 0.5 * (first + second)
    if side in ("left", "right"):
        return np.array([at, middle, -p.leaf]), np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])
    return np.array([middle, at, -p.leaf]), np.array([1.0 if side == "bottom" else -1.0, 0.0, 0.0])


def _place(value: float, low: float | None, high: float | None, p: JointSuggestionParameters) -> float | None:
    """-1 at the lower border, 1 at the upper one; None where that cannot be told."""
    if low is not None and high is not None:
        return (2 * value - low - high) / max(high - low, 1e-3)
    if high is not None and high - value < p.near:
        return 1.0
    if low is not None and value - low < p.near:
        return -1.0
    return None
