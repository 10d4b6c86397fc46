"""The box in which a tool has to stay."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.base import InverseKinematics


@dataclass(frozen=True, eq=False)
class Workspace:
    """``lower``, ``upper``: corners (3,), metres, in the base frame."""

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        corners = np.array([self.lower, self.upper])
        if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (self.lower < self.upper).all():
            raise ManipulationError(f"Workspace should have a lower and an upper corner but has {corners.tolist()}")

    @classmethod
    def from_string(cls, text: str) -> Workspace:
        """Parse ``x;y;z;x;y;z``: lower and upper corner, metres; the form of a port literal."""
        try:
            numbers = [float(part) for part in text.split(";")]
        except ValueError:
            numbers = []
        if len(numbers) != 6:
            raise ManipulationError(
                f"a workspace 'x;y;z;x;y;z' (metres, lower and upper corner) expected, got {text!r}"
            )
        return cls(np.array(numbers[:3]), np.array(numbers[3:]))

    def contains(self, point: NDArray[np.float64], slack: float = 0.0) -> bool:
        """Whether ``point`` (3,) lies inside, or no more than ``slack`` metres outside."""
        return bool((point >= self.lower - slack).all() and (point <= self.upper + slack).all())

    def first_outside(
        self, path: NDArray[np.float64], kinematics: InverseKinematics, max_step: float = 0.02
    ) -> NDArray[np.float64] | None:
        """The first tool position (3,) outside along joint waypoints (N, n); looked at each ``max_step`` rad."""
        for start, end in pairwise(path):
            count = max(1, int(np.ceil(np.abs(end - start).max() / max_step)))
            for k in range(1, count + 1):
                position = kinematics.tool_pose(start + (end - start) * k / count).position
                if not self.contains(position):
                    return position
        return None

    def __str__(self) -> str:
        spans = (
            f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in zip("xyz", self.lower, self.upper, strict=True)
        )
        return ", ".join(spans) + " m"
