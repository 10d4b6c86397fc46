"""A path constraint: the held object stays upright."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages import Pose


class Upright:
    """The held object's z axis stays within ``max_tilt`` radians of the vertical.

    ``slack``: additional tilt, radians, allowed between the planned points of a timed motion.
    """

    def __init__(
        self,
        kinematics: InverseKinematics,
        tool_from_object: Pose,
        max_tilt: float = math.radians(25.0),
        slack: float = math.radians(2.0),
    ) -> None:
        self._kinematics = kinematics
        self._up = tool_from_object.rotation[:, 2].copy()
        self._least_cosine = math.cos(max_tilt)
        self._tolerated_cosine = math.cos(max_tilt + slack)
        self._max_tilt = max_tilt

    @property
    def description(self) -> str:
        """The constraint as text, for error messages."""
        return f"the held object upright within {math.degrees(self._max_tilt):.0f} degrees"

    def satisfied(self, positions: NDArray[np.float64]) -> bool:
        """Return whether the constraint holds at ``positions`` (n,), radians."""
        return self._cosine(positions) >= self._least_cosine

    def tolerated(self, positions: NDArray[np.float64]) -> bool:
        """Return whether the constraint, relaxed by ``slack``, holds at ``positions`` (n,), radians."""
        return self._cosine(positions) >= self._tolerated_cosine

    def _cosine(self, positions: NDArray[np.float64]) -> float:
        return float(self._kinematics.tool_direction(positions, self._up)[2])
