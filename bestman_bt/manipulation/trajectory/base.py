"""Time parametrisation: from a joint path to a motion that the drives can follow."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from numpy.typing import ArrayLike

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.messages import JointTrajectory


class TrajectoryError(ManipulationError):
    """A path that cannot be timed, or whose timing breaks a limit."""


@dataclass(frozen=True)
class SpeedScale:
    """Shares of the velocity and acceleration limits that a motion may use, each above 0 and at most 1."""

    velocity: float = 0.5
    acceleration: float = 0.35

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise TrajectoryError(f"SpeedScale {name} should be above 0 and at most 1 but is {value}")


class TimeParametrization(ABC):
    """Gives a path its time; at rest at both ends."""

    @abstractmethod
    def parametrize(
        self,
        path: ArrayLike,
        limits: JointLimits,
        scale: SpeedScale | None = None,
    ) -> JointTrajectory:
        """Time ``path`` (N, n), radians, within ``scale`` (default: ``SpeedScale()``) of ``limits``.

        A path without motion gives a trajectory of one sample. Raises TrajectoryError if the path cannot be timed or
        leaves the position limits, ManipulationError for NaN or a wrong shape.
        """
