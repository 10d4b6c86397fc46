"""Motion planning: a collision-free joint path from the current positions to one of several goals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.messages import Failure, MotionObstacle


class PlanningErrorCode(StrEnum):
    """Reasons for a planning failure."""

    START_OUT_OF_LIMITS = "start_out_of_limits"
    START_IN_COLLISION = "start_in_collision"
    START_VIOLATES_CONSTRAINT = "start_violates_constraint"
    GOAL_OUT_OF_LIMITS = "goal_out_of_limits"
    GOAL_IN_COLLISION = "goal_in_collision"
    GOAL_VIOLATES_CONSTRAINT = "goal_violates_constraint"
    NO_PATH = "no_path"
    TIMEOUT = "timeout"
    TIMED_PATH_INVALID = "timed_path_invalid"


class MotionPlanningError(ManipulationError):
    """Raised if no plan was found; ``code``: a PlanningErrorCode; ``failure``: with the obstacle, if known."""

    code: PlanningErrorCode

    def __init__(self, code: PlanningErrorCode, message: str, obstacle: MotionObstacle | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.failure = Failure(code, message, obstacle=obstacle)


class PathConstraint(Protocol):
    """A condition along a whole path, besides collisions."""

    @property
    def description(self) -> str:
        """Return the condition as text for error messages: ``cup upright within 25 degrees``."""

    def satisfied(self, positions: NDArray[np.float64]) -> bool:
        """Return whether the constraint holds at ``positions`` (n,), radians; used during planning."""

    def tolerated(self, positions: NDArray[np.float64]) -> bool:
        """Return whether a timed motion may pass ``positions`` (n,), radians, which may lie slightly off the planned
        path.
        """


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """A joint path: ``path`` (N, n) radians, N ≥ 1, straight between rows, from the start to goal number
    ``goal_index``.

    ``checks``: number of collision checks.
    """

    path: NDArray[np.float64]
    goal_index: int
    checks: int

    @property
    def length(self) -> float:
        """Sum of the Euclidean lengths of the segments, radians."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


class MotionPlanner(ABC):
    """Plans motions of one arm; the result depends only on the arguments, never on time or on earlier plans."""

    @abstractmethod
    def plan(
        self,
        start: ArrayLike,
        goals: Sequence[ArrayLike],
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
        constraint: PathConstraint | None = None,
    ) -> MotionPlan:
        """Plan from ``start`` (n,) to any of ``goals``, each (n,), radians.

        Raises MotionPlanningError if no plan is found, ManipulationError for NaN, wrong shapes or no goals.
        """
