"""Inverse kinematics: from a tool pose to joint positions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import Pose


@dataclass(frozen=True, eq=False)
class IKResult:
    """The result of a search for joint positions.

    ``solutions``: (n,) arrays, radians, within the limits, nearest to the reference first; may be empty.
    ``position_error``, ``rotation_error``: metres and radians, of the first solution, or of the closest approach.
    ``attempts``: number of start positions. ``rejected``: solutions refused by ``is_valid``.
    """

    solutions: tuple[NDArray[np.float64], ...]
    position_error: float
    rotation_error: float
    attempts: int
    rejected: int = 0

    @property
    def found(self) -> bool:
        """Whether there is a solution."""
        return bool(self.solutions)

    @property
    def best(self) -> NDArray[np.float64]:
        """The solution nearest to the reference, (n,). Raises LookupError if there is none."""
        if not self.solutions:
            raise LookupError("no inverse kinematics solution was found")
        return self.solutions[0]


class InverseKinematics(ABC):
    """Finds joint positions that bring the tool of one arm to a pose in the robot's base frame."""

    @property
    @abstractmethod
    def joint_names(self) -> tuple[str, ...]:
        """The names of the n joints, in the order of every (n,) array."""

    @property
    def fingerprint(self) -> str:
        """A text of everything that the tool poses depend on, as a cache key; empty: no caching."""
        return ""

    @property
    @abstractmethod
    def reach(self) -> tuple[NDArray[np.float64], float]:
        """The shoulder (3,) in the base frame, and the largest distance of a tool pose from it, metres."""

    @abstractmethod
    def tool_pose(self, positions: ArrayLike) -> Pose:
        """Return base_from_tool at ``positions`` (n,), radians: forward kinematics."""

    @abstractmethod
    def solve(
        self,
        base_from_tool: Pose,
        reference: ArrayLike,
        rng: np.random.Generator,
        count: int = 1,
        is_valid: Callable[[NDArray[np.float64]], bool] | None = None,
        attempts: int | None = None,
    ) -> IKResult:
        """Search for up to ``count`` distinct solutions.

        ``reference``: (n,), start of the search and reference for "nearest". ``is_valid``: refuses solutions, for
        example ``CollisionWorld.is_free``. ``attempts``: number of start positions, by default the algorithm's own.
        Raises ManipulationError if ``base_from_tool`` or ``reference`` is not finite or has the wrong shape.
        """

    @abstractmethod
    def track(self, base_from_tool: Pose, start: ArrayLike) -> NDArray[np.float64] | None:
        """Return the solution (n,) that continues smoothly from ``start`` (n,), without restarts, or None if there is
        none.
        """

    @abstractmethod
    def tool_direction(self, positions: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tool's direction ``axis`` (3,) in the base frame at ``positions`` (n,); quick, checks nothing."""

    @abstractmethod
    def jacobian(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Return the tool's Jacobian (6, n) at ``positions`` (n,): linear over angular velocity, in the tool frame."""

    @abstractmethod
    def manipulability(self, positions: ArrayLike) -> float:
        """Return Yoshikawa's manipulability sqrt(det(J Jᵀ)) at ``positions`` (n,), radians; 0 at a singularity."""
