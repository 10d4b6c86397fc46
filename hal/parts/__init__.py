"""What parts of any make are built from: motions with an end, courses of set-points, checks of commands."""

from hal.parts.command_checks import JointCommandChecks
from hal.parts.motion import MotionOwner, PartMotion
from hal.parts.setpoints import Brake, BrakeThenMove, Drift, Follow, Hold, Reach, Setpoints, Stream, Trapezoid

__all__ = [
    "Brake",
    "BrakeThenMove",
    "Drift",
    "Follow",
    "Hold",
    "JointCommandChecks",
    "MotionOwner",
    "PartMotion",
    "Reach",
    "Setpoints",
    "Stream",
    "Trapezoid",
]
