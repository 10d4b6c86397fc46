"""How much of the velocity, acceleration and jerk limits a timed motion uses, as densely as it is executed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.messages import JointTrajectory


@dataclass(frozen=True)
class LimitUsage:
    """Largest shares of the limits over all joints and times: 1.0 is at the limit.

    ``jerk`` is None where no jerk limit was given. ``position``: rad (m) by which the motion leaves the joint range.
    """

    velocity: float
    acceleration: float
    jerk: float | None
    position: float

    def within(self, share: float = 1.03, position_slack: float = 1e-6) -> bool:
        """Whether no limit is used beyond ``share`` and no joint leaves its range by more than ``position_slack``."""
        used = max(self.velocity, self.acceleration, self.jerk or 0.0)
        return used <= share and self.position <= position_slack


def limit_usage(
    trajectory: JointTrajectory, limits: JointLimits, jerk: ArrayLike | None = None, rate: float = 1000.0
) -> LimitUsage:
    """Measure the motion that ``trajectory.sample`` gives at ``rate`` Hz and at every sample of its own.

    Acceleration is the change of velocity from one of its samples to the next. ``jerk``: (n,) rad/s³, limits of the
    change of those accelerations. Raises ManipulationError for other joints than the limits', or a wrong ``jerk``.
    """
    if trajectory.joint_names != limits.joint_names:
        raise ManipulationError(f"limits are of {limits.joint_names} but the motion is of {trajectory.joint_names}")
    dense = np.union1d(np.arange(0.0, trajectory.duration, 1.0 / rate), trajectory.times)
    samples = [trajectory.sample(float(time)) for time in dense]
    positions = np.array([sample[0] for sample in samples])
    velocities = np.array([sample[1] for sample in samples])
    outside = np.maximum(limits.lower - positions, positions - limits.upper)
    spans = np.diff(trajectory.times)[:, None]
    accelerations = np.diff(trajectory.velocities, axis=0) / spans
    return LimitUsage(
        velocity=float(np.max(np.abs(velocities) / limits.velocity)),
        acceleration=_largest(accelerations, limits.acceleration),
        jerk=None if jerk is None else _largest(_jerks(accelerations, spans), _jerk_limits(jerk, limits)),
        position=max(0.0, float(outside.max())),
    )


def _jerks(accelerations: NDArray[np.float64], spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Changes of the mean accelerations of neighbouring spans."""
    return np.diff(accelerations, axis=0) / (0.5 * (spans[1:] + spans[:-1]))


def _jerk_limits(jerk: ArrayLike, limits: JointLimits) -> NDArray[np.float64]:
    array = np.array(jerk, dtype=float)
    if array.shape != limits.velocity.shape or not np.isfinite(array).all() or np.any(array <= 0):
        raise ManipulationError(f"jerk should be {len(limits.joint_names)} limits above 0 but is {array}")
    return array


def _largest(values: NDArray[np.float64], limits: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(values) / limits)) if len(values) else 0.0
