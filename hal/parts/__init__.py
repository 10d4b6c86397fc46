"""What parts of any make are built from: the laws of joints, grippers and bases over channels, motions, checks."""

from hal.parts.channels import (
    BaseChannel,
    BaseReading,
    GripperChannel,
    GripperReading,
    JointChannel,
    JointReading,
)
from hal.parts.controlled_part import ControlledPart
from hal.parts.driven_base import (
    DrivenBase,
    DrivingParameters,
    MotionProfile,
    MotionProfileParameters,
)
from hal.parts.gripper import CommandedGripper
from hal.parts.interface import interface_of
from hal.parts.part_connection import ConnectionFailedError, PartConnection
from hal.parts.setpoints import Hold, Setpoints, Trapezoid
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup, StreamingParameters
from hal.parts.tool_limits import ToolLimits

__all__ = [
    "BaseChannel",
    "BaseReading",
    "CommandedGripper",
    "ConnectionFailedError",
    "ControlledPart",
    "DrivenBase",
    "DrivingParameters",
    "GripperChannel",
    "GripperReading",
    "Hold",
    "JointChannel",
    "JointReading",
    "MotionProfile",
    "MotionProfileParameters",
    "PartConnection",
    "Setpoints",
    "SimulatedClock",
    "StopLatch",
    "StreamedArm",
    "StreamedJointGroup",
    "StreamingParameters",
    "ToolLimits",
    "Trapezoid",
    "interface_of",
]
