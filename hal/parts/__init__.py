"""What parts of any make are built from: the laws of joints, grippers and bases over channels, motions, checks."""

from hal.parts.channels import (
    BaseChannel,
    BaseReading,
    ControlledPart,
    GripperChannel,
    GripperReading,
    JointChannel,
    JointReading,
    interface_of,
)
from hal.parts.driven_base import (
    Arrival,
    BaseTiming,
    DrivenBase,
    MotionProfile,
)
from hal.parts.gate import SetpointGate, ToolLimits
from hal.parts.gripper import CommandedGripper
from hal.parts.part_connection import ConnectionFailedError, PartConnection
from hal.parts.setpoints import Hold, Setpoints, Trapezoid
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup, Tracking

__all__ = [
    "Arrival",
    "BaseChannel",
    "BaseReading",
    "BaseTiming",
    "CommandedGripper",
    "ConnectionFailedError",
    "ControlledPart",
    "DrivenBase",
    "GripperChannel",
    "GripperReading",
    "Hold",
    "JointChannel",
    "JointReading",
    "MotionProfile",
    "PartConnection",
    "SetpointGate",
    "Setpoints",
    "SimulatedClock",
    "StopLatch",
    "StreamedArm",
    "StreamedJointGroup",
    "ToolLimits",
    "Tracking",
    "Trapezoid",
    "interface_of",
]
