"""Colours of generated furniture: what its body, its fronts and its handles look like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bestman_bt.configuration.quantity import Color as ColorOption
from bestman_bt.scene.furniture_generator.solid import Color

Style = Literal["white", "steel", "dark", "wood", "coloured"]

_STYLES: dict[Style, tuple[Color, Color]] = {  # of the front and of the body
    "white": ((0.93, 0.93, 0.91), (0.88, 0.88, 0.86)),
    "steel": ((0.72, 0.74, 0.77), (0.45, 0.46, 0.48)),
    "dark": ((0.13, 0.13, 0.15), (0.10, 0.10, 0.12)),
    "wood": ((0.70, 0.52, 0.34), (0.58, 0.42, 0.27)),
    "coloured": ((0.35, 0.50, 0.48), (0.86, 0.85, 0.80)),
}
_HANDLES: tuple[Color, ...] = (
    (0.60, 0.61, 0.63),  # brushed steel
    (0.12, 0.12, 0.12),  # black
    (0.72, 0.58, 0.30),  # brass
    (0.92, 0.92, 0.90),  # white
    (0.45, 0.31, 0.19),  # wood
)
_SAME_AS_FRONT = 0.3  # share of furniture whose handles have the colour of the front


@dataclass(frozen=True)
class FinishOptions:
    """Colours; what is not given is drawn. ``handle_like_front``: the handles have the colour of the front."""

    style: Style | None = None
    front: ColorOption | None = None
    body: ColorOption | None = None
    handle: ColorOption | None = None
    handle_like_front: bool | None = None


@dataclass(frozen=True)
class Finish:
    """The colours, rgb from 0 to 1."""

    front: Color
    body: Color
    handle: Color


def draw_finish(options: FinishOptions, rng: np.random.Generator, styles: tuple[Style, ...] = tuple(_STYLES)) -> Finish:
    """Colours of one of ``styles``, a little lighter or darker from piece to piece."""
    drawn, shade, tint = styles[int(rng.integers(len(styles)))], rng.uniform(0.92, 1.07), rng.uniform(0.7, 1.3, 3)
    style = options.style or drawn
    if style != "coloured":
        tint = np.ones(3)
    front_color, body_color = _STYLES[style]
    front = options.front or _shaded(front_color, shade * tint)
    body = options.body or _shaded(body_color, np.full(3, shade))
    other = _HANDLES[int(rng.integers(len(_HANDLES)))]
    like_front = bool(rng.random() < _SAME_AS_FRONT)
    if options.handle_like_front is not None:
        like_front = options.handle_like_front
    return Finish(front, body, options.handle or (front if like_front else other))


def _shaded(color: Color, factor: np.ndarray) -> Color:
    red, green, blue = (float(value) for value in np.clip(np.array(color) * factor, 0.0, 1.0))
    return red, green, blue
