"""Timed joint trajectories."""

from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, TrajectoryError
from bestman_bt.manipulation.trajectory.collision_check import Touch, first_touch
from bestman_bt.manipulation.trajectory.toppra import Toppra, ToppraParameters

__all__ = [
    "SpeedScale",
    "TimeParametrization",
    "Toppra",
    "ToppraParameters",
    "Touch",
    "TrajectoryError",
    "first_touch",
]
