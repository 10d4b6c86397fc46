"""Timed joint trajectories."""

from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, TrajectoryError
from bestman_bt.manipulation.trajectory.collision_check import Touch, first_touch
from bestman_bt.manipulation.trajectory.limit_usage import LimitUsage, limit_usage
from bestman_bt.manipulation.trajectory.path_speed import rescaled, rescaled_from, stop_along
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState, RuckigStateToStateParameters
from bestman_bt.manipulation.trajectory.toppra import Toppra, ToppraParameters

__all__ = [
    "LimitUsage",
    "RuckigStateToState",
    "RuckigStateToStateParameters",
    "SpeedScale",
    "TimeParametrization",
    "Toppra",
    "ToppraParameters",
    "Touch",
    "TrajectoryError",
    "first_touch",
    "limit_usage",
    "rescaled",
    "rescaled_from",
    "stop_along",
]
