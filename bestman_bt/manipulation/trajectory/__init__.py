"""Timed joint trajectories."""

from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, Touch, TrajectoryError, first_touch
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState
from bestman_bt.manipulation.trajectory.toppra import Toppra

__all__ = [
    "RuckigStateToState",
    "SpeedScale",
    "TimeParametrization",
    "Toppra",
    "Touch",
    "TrajectoryError",
    "first_touch",
]
