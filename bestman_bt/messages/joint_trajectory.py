"""Paths of the base and timed joint trajectories."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.handle import JointKind
from bestman_bt.messages.pose import Pose, Pose2D


@dataclass(frozen=True, eq=False)
class Path2D:
    """A path of the base. ``points``: (N, 2) metres in the map frame, in driving order; ``goal``: the final pose.

    ``reverse``: (N - 1,) bool, the segments driven backwards; empty means none.
    """

    points: NDArray[np.float64]
    goal: Pose2D
    reverse: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def __post_init__(self) -> None:
        points = frozen_array(self.points, (None, 2), "Path2D points")
        if not np.isfinite(points).all():
            first = int(np.argmin(np.isfinite(points).all(axis=1)))
            raise ValueError(f"Path2D points[{first}] is {points[first].tolist()}; it should be finite")
        self.goal.checked("Path2D goal")
        object.__setattr__(self, "points", points)
        segments = max(0, len(points) - 1)
        reverse = self.reverse if len(self.reverse) else np.zeros(segments, dtype=bool)
        object.__setattr__(self, "reverse", frozen_array(reverse, (segments,), "Path2D reverse", np.bool_))

    @property
    def length(self) -> float:
        """Length along the points, metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def joint_motion(kind: JointKind, origin: ArrayLike, axis: ArrayLike, position: float) -> Pose:
    """Return frame_from_closed, the motion of a door or drawer that is open by ``position``, radians or metres.

    ``origin``: (3,) metres, a point on the joint ``axis``, (3,) unit, both in that frame.
    """
    direction = np.asarray(axis, dtype=float)
    if kind == "prismatic":
        return Pose(position * direction)
    point = np.asarray(origin, dtype=float)
    turn = Pose(np.zeros(3), np.append(math.sin(position / 2) * direction, math.cos(position / 2)))
    return Pose(point) @ turn @ Pose(-point)


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Samples of a joint motion.

    ``joint_names``: n names. ``times``: (N,) seconds from the start, strictly rising from 0. ``positions``,
    ``velocities``: (N, n), radians or metres (per second).
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
        if not all(np.isfinite(array).all() for array in (times, self.positions, self.velocities)):
            raise ValueError("JointTrajectory times, positions and velocities should be finite")

    @property
    def duration(self) -> float:
        """Duration in seconds."""
        return float(self.times[-1])

    def sample(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return position and velocity, each (n,), at ``time`` seconds: cubic Hermite between samples, clamped at the
        ends.
        """
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
