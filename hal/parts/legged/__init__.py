"""Walking on four legs: kinematics, gait, attitude, odometry; pure, for drivers that command joint torques."""

from hal.parts.legged.trot import LegKinematics, Trot
from hal.parts.legged.walker import Attitude, LegOdometry, TrotGait

__all__ = [
    "Attitude",
    "LegKinematics",
    "LegOdometry",
    "Trot",
    "TrotGait",
]
