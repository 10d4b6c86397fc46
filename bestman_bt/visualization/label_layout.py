"""Where labels go in a picture: beside what they name, clear of each other and of what should stay in sight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels."""

GAP = 8.0
"""Pixels between a label and what it names, at the nearest."""
COVERING = 4.0
"""How much worse it is to cover what should stay in sight than to stand a few heights further away."""
RINGS = (0.0, 1.0, 2.0, 3.5, 5.0, 8.0)
"""Further distances that are tried, in heights of the label."""


@dataclass(frozen=True)
class Label:
    """``anchor``: the pixel that it names; ``size``: width and height of its box, pixels."""

    anchor: tuple[float, float]
    size: tuple[float, float]


def place_labels(
    labels: Sequence[Label], keep_clear: Sequence[Rectangle], picture: tuple[float, float]
) -> list[Rectangle]:
    """A rectangle for each label within the ``picture`` (width, height), chosen one after the other.

    Each takes the place around its anchor that covers least of the labels before it, then least of ``keep_clear``, then
    lies nearest. A label that is larger than the picture begins at its left or upper border.
    """
    placed: list[Rectangle] = []
    for label in labels:
        places = [_moved_inside(place, picture) for place in _around(label)]
        placed.append(min(places, key=lambda place: _cost(place, label, placed, keep_clear)))
    return placed


def _around(label: Label) -> list[Rectangle]:
    (x, y), (width, height) = label.anchor, label.size
    places = []
    for ring, (right, down) in product(RINGS, product((1, 0, -1), (-1, 0, 1))):
        if right or down:
            away = GAP + ring * height
            left = x + right * away - (1 - right) / 2 * width
            top = y + down * away - (1 - down) / 2 * height
            places.append((left, top, left + width, top + height))
    return places


def _moved_inside(place: Rectangle, picture: tuple[float, float]) -> Rectangle:
    left, top, right, bottom = place
    dx = max(0.0, -left) if left < 0.0 else min(0.0, picture[0] - right)
    dy = max(0.0, -top) if top < 0.0 else min(0.0, picture[1] - bottom)
    dx, dy = max(dx, -left), max(dy, -top)
    return left + dx, top + dy, right + dx, bottom + dy


def _cost(
    place: Rectangle, label: Label, labels: Sequence[Rectangle], keep_clear: Sequence[Rectangle]
) -> tuple[float, float]:
    over_labels = sum(overlap(place, other) for other in labels)
    area = label.size[0] * label.size[1]
    covered = sum(overlap(place, other) for other in keep_clear) / area
    x, y = label.anchor
    away = math.hypot(max(place[0] - x, x - place[2], 0.0), max(place[1] - y, y - place[3], 0.0))
    return over_labels, COVERING * covered + away / (6.0 * label.size[1])


def overlap(one: Rectangle, other: Rectangle) -> float:
    """Pixels that two rectangles share."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    return max(0.0, width) * max(0.0, height)
