"""A chunk as a timed motion: at the chunk's own pace, slower where the arm's limits ask for it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.joint_values import JointLimits, joint_path
from bestman_bt.manipulation.policy.errors import PolicyActionError
from bestman_bt.manipulation.trajectory import SpeedScale, limit_usage
from bestman_bt.messages import JointTrajectory

MAX_SLOWDOWN = 20.0
"""A chunk that would have to be slower than this has no sense as a motion: a jump, not a step."""


def chunk_trajectory(path: NDArray[np.float64], dt: float, limits: JointLimits, scale: SpeedScale) -> JointTrajectory:
    """The motion through ``path`` (H + 1, n), radians, ``dt`` seconds apart, at rest at both ends.

    Between them velocities are central differences and the motion is cubic. Where that is beyond ``scale`` of the
    limits, the whole chunk is stretched in time. Raises PolicyActionError where it would take 20 times as long.
    """
    path = joint_path(path, len(limits.joint_names), "path")
    velocities = np.zeros(path.shape)
    velocities[1:-1] = (path[2:] - path[:-2]) / (2.0 * dt)
    times = np.linspace(0.0, (len(path) - 1) * dt, len(path))
    quick = JointTrajectory(limits.joint_names, times, path, velocities)
    # A cubic's acceleration is largest at its ends: half of a sample step apart shows it well enough.
    fine = np.linspace(0.0, float(times[-1]), 2 * len(path) - 1)
    states = [quick.sample(float(time)) for time in fine]
    dense = JointTrajectory(
        limits.joint_names, fine, np.array([state[0] for state in states]), np.array([state[1] for state in states])
    )
    usage = limit_usage(dense, limits, rate=2.0 / dt)
    slowdown = max(1.0, usage.velocity / scale.velocity, math.sqrt(usage.acceleration / scale.acceleration))
    if slowdown > MAX_SLOWDOWN:
        raise PolicyActionError(f"the chunk jumps: within the limits it would take {slowdown:.0f} times its time")
    return JointTrajectory(limits.joint_names, times * slowdown, path, velocities / slowdown)
