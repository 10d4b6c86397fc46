"""Timed joint motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Samples of a joint motion.

    ``joint_names``: n names. ``times``: (N,) seconds from the start, strictly rising from 0.
    ``positions``, ``velocities``: (N, n), radians or metres (per second).
    """

    joint_names: tuple[str, ...]
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        times = frozen_array(self.times, (None,), "JointTrajectory times")
        if len(times) == 0 or times[0] != 0.0 or np.any(np.diff(times) <= 0):
            raise ValueError("JointTrajectory times should rise strictly from 0")
        object.__setattr__(self, "times", times)
        for name in ("positions", "velocities"):
            array = frozen_array(getattr(self, name), (len(times), n), f"JointTrajectory {name}")
            object.__setattr__(self, name, array)

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return float(self.times[-1])

    def sample(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position and velocity, each (n,), at ``time`` seconds: cubic Hermite between samples, held at the ends."""
        if time <= 0.0:
            return self.positions[0], self.velocities[0]
        if time >= self.times[-1]:
            return self.positions[-1], np.zeros(self.positions.shape[1])
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        h = self.times[i + 1] - self.times[i]
        s = (time - self.times[i]) / h
        p0, p1 = self.positions[i], self.positions[i + 1]
        m0, m1 = self.velocities[i] * h, self.velocities[i + 1] * h
        position = (
            (2 * s**3 - 3 * s**2 + 1) * p0
            + (s**3 - 2 * s**2 + s) * m0
            + (-2 * s**3 + 3 * s**2) * p1
            + (s**3 - s**2) * m1
        )
        velocity = ((6 * s**2 - 6 * s) * (p0 - p1) + (3 * s**2 - 4 * s + 1) * m0 + (3 * s**2 - 2 * s) * m1) / h
        return position, velocity
