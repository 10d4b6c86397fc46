"""Walking on four legs: kinematics, gait, attitude, odometry; pure, for drivers that command joint torques."""

from hal.parts.legged.attitude import Attitude
from hal.parts.legged.leg_kinematics import LegKinematics
from hal.parts.legged.leg_odometry import LegOdometry
from hal.parts.legged.trot import Trot
from hal.parts.legged.walker import Walker

__all__ = [
    "Attitude",
    "LegKinematics",
    "LegOdometry",
    "Trot",
    "Walker",
]
