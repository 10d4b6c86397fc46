"""Timed joint trajectories."""

from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, TrajectoryError
from bestman_bt.manipulation.trajectory.collision_check import Touch, first_touch
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState, RuckigStateToStateParameters
from bestman_bt.manipulation.trajectory.toppra import Toppra, ToppraParameters

__all__ = [
    "RuckigStateToState",
    "RuckigStateToStateParameters",
    "SpeedScale",
    "TimeParametrization",
    "Toppra",
    "ToppraParameters",
    "Touch",
    "TrajectoryError",
    "first_touch",
]
