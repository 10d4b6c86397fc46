"""Real robots: one clock, one stop, one watchdog and one set of limits over the controllers of several vendors."""

from hal.hardware.channels import (
    BaseChannel,
    BaseReading,
    GripperChannel,
    GripperReading,
    JointChannel,
    JointReading,
)
from hal.hardware.clock import RealTimeClock
from hal.hardware.connection import Connection
from hal.hardware.control_loop import ControlLoop, Lateness
from hal.hardware.driven_base import DrivenBase, DrivingParameters
from hal.hardware.fault import ConnectionFailedError, Fault
from hal.hardware.hardware_gripper import GripperParameters, HardwareGripper
from hal.hardware.hardware_part import HardwarePart
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.late_watch import LateWatch
from hal.hardware.remote_time import RemoteTime
from hal.hardware.robot import HardwareRobot
from hal.hardware.sensors import (
    HardwareBattery,
    HardwareCamera,
    HardwareForceTorque,
    HardwareImu,
    HardwareLidar,
    HardwareSensor,
)
from hal.hardware.stop_latch import StopLatch
from hal.hardware.streamed_arm import StreamedArm
from hal.hardware.streamed_joints import StreamedJointGroup
from hal.hardware.streaming import StreamingParameters
from hal.hardware.tool_limits import ToolLimits

__all__ = [
    "BaseChannel",
    "BaseReading",
    "Connection",
    "ConnectionFailedError",
    "ControlLoop",
    "DrivenBase",
    "DrivingParameters",
    "Fault",
    "GripperChannel",
    "GripperParameters",
    "GripperReading",
    "HardwareBattery",
    "HardwareCamera",
    "HardwareForceTorque",
    "HardwareGripper",
    "HardwareImu",
    "HardwareLidar",
    "HardwarePart",
    "HardwareRobot",
    "HardwareSensor",
    "IsolatedRobot",
    "JointChannel",
    "JointReading",
    "LateWatch",
    "Lateness",
    "RealTimeClock",
    "RemoteTime",
    "StopLatch",
    "StreamedArm",
    "StreamedJointGroup",
    "StreamingParameters",
    "ToolLimits",
]
