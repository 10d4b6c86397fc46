"""Changing the speed of a running motion without leaving its path: stopping, slowing, speeding up again.

The path parameter is the motion's own time s; its rate goes from 1 to what is asked as fast as the acceleration limits
allow, q̈ = q'(s) s̈ + q''(s) ṡ² (Bobrow, Dubowsky and Gibson, "Time-optimal control of robotic manipulators along
specified paths", 1985).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.trajectory.base import TrajectoryError
from bestman_bt.manipulation.trajectory.limit_usage import limit_usage
from bestman_bt.messages import JointTrajectory

_STEP = 0.001
_SAMPLE_STEPS = 4
_AT_REST = 1e-9


def stop_along(trajectory: JointTrajectory, time: float, limits: JointLimits) -> JointTrajectory:
    """From ``time`` seconds into the motion to rest, on the same geometric path, within the acceleration limits.

    Its times count from ``time``. Where the motion ends sooner than it can be stopped, it ends as planned. A motion
    that is over gives one sample. Raises ManipulationError for a time that is not finite or other joints.
    """
    return _at_rate(trajectory, time, 0.0, limits)


def rescaled(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    """The whole motion at ``factor`` times its speed: velocities scale with it, accelerations with its square."""
    _check_factor(factor)
    return JointTrajectory(
        trajectory.joint_names, trajectory.times / factor, trajectory.positions, trajectory.velocities * factor
    )


def rescaled_from(trajectory: JointTrajectory, time: float, factor: float, limits: JointLimits) -> JointTrajectory:
    """What remains of a running motion after ``time``, its speed brought smoothly to ``factor`` times the planned one.

    Its times count from ``time``. Raises TrajectoryError if at that speed the motion would break the limits.
    """
    _check_factor(factor)
    used = limit_usage(trajectory, limits)
    highest = min(1.03 / max(used.velocity, 1e-9), math.sqrt(1.03 / max(used.acceleration, 1e-9)))
    if factor > max(1.0, highest):
        raise TrajectoryError(f"the limits allow this motion a speed factor of {highest:.2f} but {factor} was asked")
    return _at_rate(trajectory, time, factor, limits)


def _check_factor(factor: float) -> None:
    if not (math.isfinite(factor) and factor > 0.0):
        raise ManipulationError(f"speed factor should be above 0 but is {factor}; to stop, use stop_along")


def _at_rate(trajectory: JointTrajectory, time: float, rate: float, limits: JointLimits) -> JointTrajectory:
    if not math.isfinite(time):
        raise ManipulationError(f"time in a motion should be finite but is {time}")
    if trajectory.joint_names != limits.joint_names:
        raise ManipulationError(f"limits are of {limits.joint_names} but the motion is of {trajectory.joint_names}")
    s, speed, end = max(0.0, time), 1.0, trajectory.duration
    if s >= end:
        last = trajectory.positions[-1:]
        return JointTrajectory(trajectory.joint_names, np.zeros(1), last, np.zeros_like(last))
    times, marks = [0.0], [(s, 1.0)]
    now, step = 0.0, 0
    while s < end and (rate > 0.0 or speed > _AT_REST):
        # The acceleration of the motion changes on the way: what holds at both ends of a step is taken.
        change = min(
            (_rate_change(trajectory, min(s + ahead, end), speed, rate, limits) for ahead in (0.0, speed * _STEP)),
            key=abs,
        )
        following = speed + change * _STEP
        following = max(rate, following) if speed > rate else min(rate, following)
        mean, span = 0.5 * (speed + following), _STEP
        if s + mean * _STEP >= end:
            span = (end - s) / mean
            s = end
        else:
            s += mean * _STEP
        speed, now, step = following, now + span, step + 1
        if step % _SAMPLE_STEPS == 0 or s >= end or speed <= _AT_REST:
            times.append(now)
            marks.append((s, speed))
    positions, velocities = _samples(trajectory, marks)
    velocities[-1] = 0.0
    return JointTrajectory(trajectory.joint_names, np.array(times), positions, velocities)


def _rate_change(trajectory: JointTrajectory, s: float, speed: float, rate: float, limits: JointLimits) -> float:
    """The strongest s̈ towards ``rate`` that keeps every joint's acceleration; 0 where the motion itself uses it up."""
    if speed == rate:
        return 0.0
    tangent, curvature = _derivatives(trajectory, s)
    used = curvature * speed**2
    sign = -1.0 if speed > rate else 1.0
    room = np.maximum(0.0, limits.acceleration - np.sign(tangent) * sign * used)
    moving = np.abs(tangent) > 1e-9
    strongest = float(np.min(room[moving] / np.abs(tangent[moving]))) if moving.any() else math.inf
    return sign * min(strongest, abs(speed - rate) / _STEP)


def _derivatives(trajectory: JointTrajectory, s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """First and second derivative (n,) of the cubic Hermite interpolation of ``JointTrajectory.sample``."""
    i = min(int(np.searchsorted(trajectory.times, s, side="right")) - 1, len(trajectory.times) - 2)
    h = trajectory.times[i + 1] - trajectory.times[i]
    u = (s - trajectory.times[i]) / h
    p0, p1 = trajectory.positions[i], trajectory.positions[i + 1]
    m0, m1 = trajectory.velocities[i] * h, trajectory.velocities[i + 1] * h
    first = ((6 * u**2 - 6 * u) * (p0 - p1) + (3 * u**2 - 4 * u + 1) * m0 + (3 * u**2 - 2 * u) * m1) / h
    second = ((12 * u - 6) * (p0 - p1) + (6 * u - 4) * m0 + (6 * u - 2) * m1) / h**2
    return first, second


def _samples(
    trajectory: JointTrajectory, marks: list[tuple[float, float]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    states = [(trajectory.sample(s), speed) for s, speed in marks]
    return np.array([state[0] for state, _ in states]), np.array([state[1] * speed for state, speed in states])
