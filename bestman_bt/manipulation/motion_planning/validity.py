"""What a planner asks of a configuration: collisions, the constraint, and a count of the questions."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.motion_planning.base import PathConstraint, PlanningError, PlanningErrorCode

_CHECKS_BETWEEN_LOOKS_AT_THE_CLOCK = 256


class CountedValidity:
    """Free of collisions and within the constraint, as a Python ``bool`` (OMPL refuses numpy's).

    ``wall_limit``: seconds after which it raises PlanningError (``timeout``). A result never depends on it.
    """

    def __init__(self, world: CollisionWorld, constraint: PathConstraint | None, wall_limit: float) -> None:
        self._is_free = world.is_free
        self._constraint = constraint
        self._wall_limit = wall_limit
        self._end = time.monotonic() + wall_limit
        self.checks = 0

    def __call__(self, positions: NDArray[np.float64]) -> bool:
        """Whether the arm may stand at ``positions`` (n,)."""
        self.checks += 1
        if self.checks % _CHECKS_BETWEEN_LOOKS_AT_THE_CLOCK == 0 and time.monotonic() > self._end:
            raise PlanningError(
                PlanningErrorCode.TIMEOUT,
                f"planning was aborted after {self._wall_limit:g} s and {self.checks} checks",
            )
        if self._constraint is not None and not self._constraint.satisfied(positions):
            return False
        return bool(self._is_free(positions))
