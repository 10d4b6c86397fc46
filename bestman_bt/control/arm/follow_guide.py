"""What a plan foresees for a hand that goes along with a door or drawer: its turn and the arm's posture on the way."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FollowGuide:
    """By the length of the way, ``ways`` (N,) metres, increasing.

    ``turns``: (N,) radians by which the hand has turned about the joint's axis since it took hold, positive as the way
    goes. ``postures``: (N, n) joint positions; where the way really leads elsewhere, the arm is as near to them as its
    redundancy allows. ``held_at``: (3,) metres in the tool frame, where the hand holds the handle, or touches what it
    pushes: what goes along the way, and what the hand turns about.
    """

    ways: Array
    turns: Array
    postures: Array
    held_at: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        count = len(self.ways)
        if count < 2 or self.turns.shape != (count,) or len(self.postures) != count or np.any(np.diff(self.ways) <= 0):
            shapes = f"{self.ways.shape}, {self.turns.shape}, {self.postures.shape}"
            raise ValueError(f"a guide needs two or more increasing ways, each with a turn and a posture; got {shapes}")

    def turn(self, way: float) -> float:
        """The hand's turn after ``way`` metres, radians."""
        return float(np.interp(way, self.ways, self.turns))

    def posture(self, way: float) -> Array:
        """The arm's posture (n,) after ``way`` metres."""
        return np.array([np.interp(way, self.ways, column) for column in self.postures.T])
