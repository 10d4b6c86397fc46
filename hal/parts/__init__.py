"""What parts of any make are built from: the laws of joints, grippers and bases over channels, motions, checks."""

from hal.parts.base_command_checks import BaseCommandChecks
from hal.parts.channels import (
    BaseChannel,
    BaseReading,
    GripperChannel,
    GripperReading,
    JointChannel,
    JointReading,
)
from hal.parts.command_checks import JointCommandChecks
from hal.parts.controlled_part import ControlledPart, StoppablePart
from hal.parts.driven_base import DrivenBase, DrivingParameters, MotionProfile, MotionProfileParameters
from hal.parts.gripper import CommandedGripper, GripperParameters
from hal.parts.gripper_command_checks import GripperCommandChecks
from hal.parts.interface import Interface, interface_of
from hal.parts.part_connection import ConnectionFailedError, PartConnection
from hal.parts.setpoints import Brake, BrakeThenMove, Drift, Follow, Hold, Reach, Setpoints, Stream, Trapezoid
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup, StreamingParameters
from hal.parts.tool_limits import ToolLimits

__all__ = [
    "BaseChannel",
    "BaseCommandChecks",
    "BaseReading",
    "Brake",
    "BrakeThenMove",
    "CommandedGripper",
    "ConnectionFailedError",
    "ControlledPart",
    "Drift",
    "DrivenBase",
    "DrivingParameters",
    "Follow",
    "GripperChannel",
    "GripperCommandChecks",
    "GripperParameters",
    "GripperReading",
    "Hold",
    "Interface",
    "JointChannel",
    "JointCommandChecks",
    "JointReading",
    "MotionProfile",
    "MotionProfileParameters",
    "PartConnection",
    "Reach",
    "Setpoints",
    "SimulatedClock",
    "StopLatch",
    "StoppablePart",
    "Stream",
    "StreamedArm",
    "StreamedJointGroup",
    "StreamingParameters",
    "ToolLimits",
    "Trapezoid",
    "interface_of",
]
