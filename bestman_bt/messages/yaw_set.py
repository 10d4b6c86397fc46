"""Yaws that an object may have, as far as it was seen: a set of arcs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bestman_bt.messages.pose import wrap_angle


@dataclass(frozen=True)
class YawSet:
    """``arcs``: (middle, half width) pairs in radians about z of the frame, disjoint; the likeliest first.

    An object without a yaw (a body of revolution) has the empty set: there is nothing to know.
    """

    arcs: tuple[tuple[float, float], ...] = ()

    @property
    def width(self) -> float:
        """Sum of the arcs' full widths, radians; 0 to 2π."""
        return min(2.0 * math.pi, sum(2.0 * half for _, half in self.arcs))

    def contains(self, yaw: float) -> bool:
        """Whether ``yaw`` lies in one of the arcs; the empty set holds every yaw."""
        return not self.arcs or any(abs(wrap_angle(yaw - middle)) <= half for middle, half in self.arcs)

    def turned(self, angle: float) -> YawSet:
        """The set after the frame's content is turned by ``angle`` radians about z."""
        return YawSet(tuple((wrap_angle(middle + angle), half) for middle, half in self.arcs))
