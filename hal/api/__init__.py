"""The Robotics API: the common interface of all robots, simulated or real. No call blocks."""

from bestman_bt.errors import RobotError
from bestman_bt.messages import Failure, MotionErrorCode
from hal.api.errors import (
    CommandRefusedError,
    NoDataError,
    NotConnectedError,
    PartError,
    RobotStoppedError,
    UnknownPartError,
)
from hal.api.motion import Motion, MotionStatus
from hal.api.part import Arm, Gripper, GripperState, JointGroup, MobileBase, Part, Sensor
from hal.api.robot import Clock, Robot, Timer
from hal.api.sensors import (
    Battery,
    BatteryReading,
    Bumper,
    BumperReading,
    BumperZone,
    Camera,
    ForceTorque,
    Imu,
    ImuReading,
    Lidar,
    Tactile,
    TactileReading,
)

__all__ = [
    "Arm",
    "Battery",
    "BatteryReading",
    "Bumper",
    "BumperReading",
    "BumperZone",
    "Camera",
    "Clock",
    "CommandRefusedError",
    "Failure",
    "ForceTorque",
    "Gripper",
    "GripperState",
    "Imu",
    "ImuReading",
    "JointGroup",
    "Lidar",
    "MobileBase",
    "Motion",
    "MotionErrorCode",
    "MotionStatus",
    "NoDataError",
    "NotConnectedError",
    "Part",
    "PartError",
    "Robot",
    "RobotError",
    "RobotStoppedError",
    "Sensor",
    "Tactile",
    "TactileReading",
    "Timer",
    "UnknownPartError",
]
