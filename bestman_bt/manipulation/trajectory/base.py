"""Time parametrisation: from a joint path to a motion that the drives can follow."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.messages import JointTrajectory

if TYPE_CHECKING:
    from bestman_bt.manipulation.collision.base import CollisionWorld


@dataclass(frozen=True)
class Touch:
    """The first contact of a motion: ``time`` in seconds from its start, ``pairs`` of names nearer than their
    padding.
    """

    time: float
    pairs: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        return f"at {self.time:.2f} s: " + ", ".join(f"{a} with {b}" for a, b in self.pairs)


def first_touch(
    trajectory: JointTrajectory, world: CollisionWorld, max_time: float = 0.01, max_step: float = 0.01
) -> Touch | None:
    """Return the first collision of the sampled trajectory, or None if it is free of collisions.

    Points are at most ``max_time`` seconds and about ``max_step`` rad (Euclidean) apart.
    """
    for time, positions in dense_samples(trajectory, max_time, max_step):
        if not world.is_free(positions):
            return Touch(time, world.colliding_pairs(positions))
    return None


def dense_samples(
    trajectory: JointTrajectory, max_time: float, max_step: float
) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Yield (time, positions (n,)) along the motion, at most ``max_time`` seconds and about ``max_step`` rad apart."""
    yield 0.0, trajectory.positions[0]
    times, positions = trajectory.times, trajectory.positions
    for i in range(len(times) - 1):
        span = float(times[i + 1] - times[i])
        moved = float(np.linalg.norm(positions[i + 1] - positions[i]))
        count = max(1, math.ceil(span / max_time - 1e-9), math.ceil(moved / max_step - 1e-9))
        for k in range(1, count):
            time = float(times[i]) + span * k / count
            yield time, trajectory.sample(time)[0]
        yield float(times[i + 1]), positions[i + 1]


class TrajectoryError(ManipulationError):
    """A path that cannot be timed, or whose timing violates a limit."""


@dataclass(frozen=True)
class SpeedScale:
    """Fractions of the velocity and acceleration limits that a motion may use, each above 0 and at most 1."""

    velocity: float = 0.5
    acceleration: float = 0.35

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise TrajectoryError(f"SpeedScale {name} should be above 0 and at most 1 but is {value}")

    def of(self, limits: JointLimits) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the usable velocities and accelerations (n,). Raises TrajectoryError if they are not positive and
        finite.
        """
        for name in ("velocity", "acceleration"):
            values = np.asarray(getattr(limits, name), dtype=float)
            for joint, value in zip(limits.joint_names, values, strict=True):
                if not 0.0 < value < math.inf:
                    raise TrajectoryError(f"the {name} limit of {joint} should be above 0 and finite but is {value}")
        return limits.velocity * self.velocity, limits.acceleration * self.acceleration


class TimeParametrization(ABC):
    """Assigns times to a joint path, at rest at both ends."""

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
