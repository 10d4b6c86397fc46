"""Jerk-limited motion from one state of motion to another by ruckig, computed locally.

Berscheid and Kröger, "Jerk-limited real-time trajectory generation with arbitrary target states", RSS 2021.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import ruckig
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.trajectory.base import SpeedScale, TrajectoryError
from bestman_bt.messages import JointTrajectory
from bestman_bt.messages.shapes import Positive


@dataclass(frozen=True)
class RuckigStateToState:
    """The fastest motion between two states within velocity, acceleration and jerk limits.

    It does not consider obstacles: check the result with ``first_touch``. ``jerk_time``: seconds in which a joint may
    go from rest to full acceleration, which defines the jerk limits. ``rate``: Hz of the result, which also has a
    sample at each change of jerk, so that it is exactly cubic between samples. ``straight``: from rest to rest, move on
    the straight joint-space line.
    """

    jerk_time: Positive = 0.1
    rate: Positive = 100.0
    straight: bool = True

    def jerk_limits(self, limits: JointLimits, scale: SpeedScale | None = None) -> NDArray[np.float64]:
        """Return the jerk limits (n,) in rad/s³ of ``plan``."""
        return limits.acceleration * (scale or SpeedScale()).acceleration / self.jerk_time

    def plan(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        limits: JointLimits,
        scale: SpeedScale | None = None,
        start_velocity: ArrayLike | None = None,
        goal_velocity: ArrayLike | None = None,
    ) -> JointTrajectory:
        """Return the motion from ``start`` to ``goal`` (n,), with velocities (n,) rad/s (default: at rest), within
        ``scale`` of the limits.

        Equal start and goal at rest give a trajectory of one sample. Raises TrajectoryError if a velocity exceeds its
        limit or the motion leaves the position limits, ManipulationError for NaN or a wrong shape.
        """
        scale, count = scale or SpeedScale(), len(limits.joint_names)
        rest = np.zeros(count)
        ends = joint_vector(start, count, "start"), joint_vector(goal, count, "goal")
        speeds = (
            joint_vector(rest if start_velocity is None else start_velocity, count, "start_velocity"),
            joint_vector(rest if goal_velocity is None else goal_velocity, count, "goal_velocity"),
        )
        fastest, hardest = scale.of(limits)
        for speed, what in zip(speeds, ("start", "goal"), strict=True):
            _check_speed(speed, fastest, limits, what)
        if np.array_equal(*ends) and not np.any(speeds):
            return JointTrajectory(limits.joint_names, np.zeros(1), ends[0][None], rest[None])
        request = ruckig.InputParameter(count)
        request.current_position, request.target_position = ends[0].tolist(), ends[1].tolist()
        request.current_velocity, request.target_velocity = speeds[0].tolist(), speeds[1].tolist()
        request.max_velocity = fastest.tolist()
        request.max_acceleration = hardest.tolist()
        request.max_jerk = self.jerk_limits(limits, scale).tolist()
        if self.straight:
            request.synchronization = ruckig.Synchronization.Phase
        motion = ruckig.Trajectory(count)
        result = ruckig.Ruckig(count).calculate(request, motion)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise TrajectoryError(f"ruckig found no motion from {ends[0]} to {ends[1]}: {result}")
        _check_extrema(motion, limits)
        return self._sampled(motion, limits)

    def _sampled(self, motion: ruckig.Trajectory, limits: JointLimits) -> JointTrajectory:
        duration = float(motion.duration)
        marks = [np.linspace(0.0, duration, max(2, math.ceil(duration * self.rate) + 1))]
        marks.extend(np.cumsum([*profile.brake.t, *profile.t]) for profile in motion.profiles[0])
        times = np.sort(np.concatenate(marks))
        times = times[(times < duration - 1e-6) & np.append(True, np.diff(times) > 1e-6)]
        times = np.append(times, duration)
        states = [motion.at_time(float(time)) for time in times]
        return JointTrajectory(
            limits.joint_names,
            times,
            np.array([state[0] for state in states]),
            np.array([state[1] for state in states]),
        )


def _check_speed(speed: NDArray[np.float64], fastest: NDArray[np.float64], limits: JointLimits, what: str) -> None:
    worst = int(np.argmax(np.abs(speed) / fastest))
    if abs(speed[worst]) > fastest[worst] * (1 + 1e-9):
        raise TrajectoryError(
            f"{what} velocity of {limits.joint_names[worst]} should be within {fastest[worst]:.3f} "
            f"but is {speed[worst]:.3f}: slow down along the path first, or allow a higher SpeedScale"
        )


def _check_extrema(motion: ruckig.Trajectory, limits: JointLimits) -> None:
    for name, bound, lower, upper in zip(
        limits.joint_names, motion.position_extrema, limits.lower, limits.upper, strict=True
    ):
        for value in (bound.min, bound.max):
            if not lower - 1e-9 <= value <= upper + 1e-9:
                raise TrajectoryError(f"the motion takes {name} to {value:.4f}, allowed {lower:.4f} to {upper:.4f}")
