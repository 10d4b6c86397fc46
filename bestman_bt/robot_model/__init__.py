"""Robots composed from parts: one URDF with groups, frames, sensors and postures."""

from bestman_bt.robot_model.combination import combine
from bestman_bt.robot_model.compose import compose_robot, load_robot_model
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.kinematic_chain import arm_of, joints_above
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    JointGroupModel,
    LegModel,
    RobotModel,
)
from bestman_bt.robot_model.part_fields import EncodersConfig
from bestman_bt.robot_model.payload import Payload, payload
from bestman_bt.robot_model.sensor_parts import (
    BatteryPart,
    CameraPart,
    ForceTorquePart,
    ImuPart,
    LidarPart,
    MountedBumper,
    MountedForceTorque,
    TactilePart,
)

__all__ = [
    "ArmModel",
    "BaseModel",
    "BatteryPart",
    "CameraPart",
    "EncodersConfig",
    "ForceTorquePart",
    "GripperModel",
    "ImuPart",
    "JointGroupModel",
    "LegModel",
    "LidarPart",
    "MimicJoint",
    "MountedBumper",
    "MountedForceTorque",
    "Payload",
    "RobotModel",
    "TactilePart",
    "arm_of",
    "combine",
    "compose_robot",
    "joints_above",
    "load_robot_model",
    "payload",
]
