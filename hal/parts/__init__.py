"""What parts of any make are built from: motions with an end, courses of set-points, checks of commands."""

from hal.parts.base_command_checks import BaseCommandChecks
from hal.parts.command_checks import JointCommandChecks
from hal.parts.gripper_command_checks import GripperCommandChecks
from hal.parts.interface import Interface, interface_of
from hal.parts.motion import MotionOwner, PartMotion
from hal.parts.setpoints import Brake, BrakeThenMove, Drift, Follow, Hold, Reach, Setpoints, Stream, Trapezoid
from hal.parts.simulated_clock import SimulatedClock

__all__ = [
    "BaseCommandChecks",
    "Brake",
    "BrakeThenMove",
    "Drift",
    "Follow",
    "GripperCommandChecks",
    "Hold",
    "Interface",
    "JointCommandChecks",
    "MotionOwner",
    "PartMotion",
    "Reach",
    "Setpoints",
    "SimulatedClock",
    "Stream",
    "Trapezoid",
    "interface_of",
]
