"""Time-optimal parametrisation by toppra, slowed down where its samples exceed the limits.

Pham and Pham, "A new approach to time-optimal path parameterization based on reachability analysis", T-RO 2018.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.joint_values import JointLimits, joint_path
from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, TrajectoryError
from bestman_bt.messages import JointTrajectory
from bestman_bt.messages.shapes import Count, Positive

if TYPE_CHECKING:
    import toppra


_SAME = 1e-4
"""Radians; waypoints that are nearer to each other count as one."""


@dataclass(frozen=True)
class Toppra(TimeParametrization):
    """A cubic spline along the path, as fast as velocity and acceleration limits allow.

    ``waypoint_spacing``: rad between points of the spline (a sparse spline deviates from the path by up to 0.45 rad).
    ``grid_per_waypoint``, ``min_grid``: points at which toppra enforces the limits; accelerations exceed them by a few
    percent in between, which is measured at ``check_rate`` Hz and removed by slowing down the whole motion. ``rate``:
    Hz of the result. ``position_slack``: rad by which the first sample may be outside its limits.
    """

    waypoint_spacing: Annotated[Positive, "rad"] = 0.05
    grid_per_waypoint: Count = 4
    min_grid: Count = 200
    check_rate: Annotated[Positive, "Hz"] = 1000.0
    rate: Annotated[Positive, "Hz"] = 100.0
    position_slack: Annotated[float, "rad"] = 0.01

    def __post_init__(self) -> None:
        import toppra  # noqa: F401 - now, for it takes half a second, which the first motion does not have

    def parametrize(self, path: ArrayLike, limits: JointLimits, scale: SpeedScale | None = None) -> JointTrajectory:
        """Time ``path`` (N, n) within ``scale`` of ``limits``; raises the errors of the base class."""
        count = len(limits.joint_names)
        waypoints = _densified(joint_path(path, count, "path"), self.waypoint_spacing)
        if len(waypoints) < 2:
            return JointTrajectory(limits.joint_names, np.zeros(1), waypoints, np.zeros((1, count)))
        velocity, acceleration = (scale or SpeedScale()).of(limits)
        motion = self._solve(waypoints, velocity, acceleration)
        stretch = self._overshoot(motion, velocity, acceleration)
        duration = motion.duration * stretch
        times = np.linspace(0.0, duration, max(2, math.ceil(duration * self.rate) + 1))
        positions = motion(times / stretch)
        velocities = motion(times / stretch, 1) / stretch
        positions[[0, -1]] = waypoints[[0, -1]]
        velocities[[0, -1]] = 0.0
        _check_positions(positions, limits, self.position_slack)
        return JointTrajectory(limits.joint_names, times, positions, velocities)

    def _solve(
        self, waypoints: NDArray[np.float64], velocity: NDArray[np.float64], acceleration: NDArray[np.float64]
    ) -> toppra.interpolator.AbstractGeometricPath:
        import toppra
        from toppra import algorithm, constraint

        lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
        marks = np.concatenate([[0.0], np.cumsum(lengths)])
        grid = max(self.min_grid, self.grid_per_waypoint * len(waypoints))
        solver = algorithm.TOPPRA(
            [
                constraint.JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
                constraint.JointAccelerationConstraint(
                    np.stack([-acceleration, acceleration], axis=1),
                    discretization_scheme=constraint.DiscretizationType.Interpolation,
                ),
            ],
            toppra.SplineInterpolator(marks, waypoints),
            gridpoints=np.linspace(0.0, marks[-1], grid),
            solver_wrapper="seidel",
            parametrizer="ParametrizeConstAccel",
        )
        motion = solver.compute_trajectory(0.0, 0.0)
        if motion is None:
            raise TrajectoryError(f"toppra found no timing for a path of {len(waypoints)} points, {marks[-1]:.3f} rad")
        return motion

    def _overshoot(
        self,
        motion: toppra.interpolator.AbstractGeometricPath,
        velocity: NDArray[np.float64],
        acceleration: NDArray[np.float64],
    ) -> float:
        """Return how many times longer the motion has to take so that every sample keeps the limits; at least 1."""
        times = np.linspace(0.0, motion.duration, max(2, math.ceil(motion.duration * self.check_rate)))
        too_fast = float(np.max(np.abs(motion(times, 1)) / velocity))
        too_hard = float(np.max(np.abs(motion(times, 2)) / acceleration))
        return max(1.0, too_fast, math.sqrt(too_hard))


def _densified(path: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return the path with points at most ``spacing`` rad apart.

    Repeated points are left out, because toppra refuses them, and ones that are nearly the same, because a spline turns
    sharply between them. The two ends stay.
    """
    points = [path[0]]
    for index, waypoint in enumerate(path[1:], start=2):
        gap = float(np.linalg.norm(waypoint - points[-1]))
        only_motion = index == len(path) and len(points) == 1
        if gap < (1e-6 if only_motion else _SAME):
            continue
        count = math.ceil(gap / spacing)
        start = points[-1]
        points += [start + (i / count) * (waypoint - start) for i in range(1, count + 1)]
    if len(points) > 1:
        while len(points) > 2 and np.linalg.norm(path[-1] - points[-2]) < _SAME:
            points.pop()
        points[-1] = path[-1]
    return np.array(points)


def _check_positions(positions: NDArray[np.float64], limits: JointLimits, slack: float) -> None:
    outside = np.maximum(limits.lower - positions, positions - limits.upper)
    row, joint = np.unravel_index(int(np.argmax(outside)), outside.shape)
    if outside[row, joint] > slack:
        raise TrajectoryError(
            f"the path takes {limits.joint_names[joint]} to {positions[row, joint]:.4f}, "
            f"allowed {limits.lower[joint]:.4f} to {limits.upper[joint]:.4f}"
        )
