"""Timed joint trajectories."""

from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, TrajectoryError

__all__ = ["SpeedScale", "TimeParametrization", "TrajectoryError"]
