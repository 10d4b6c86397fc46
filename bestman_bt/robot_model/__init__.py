"""Robots composed from parts: one URDF with groups, frames, sensors and postures."""

from bestman_bt.robot_model.compose import combine, compose_robot, load_robot_model
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    JointedModel,
    JointGroupModel,
    LeggedBaseModel,
    LegModel,
    RobotModel,
    WheeledBaseModel,
)
from bestman_bt.robot_model.part_config import (
    ArmPart,
    BasePart,
    GripperPart,
    JointGroupPart,
    LeggedBasePart,
    MobilePart,
    SuctionPart,
)
from bestman_bt.robot_model.part_fields import EncodersConfig, JointLimitsConfig, PartConfig
from bestman_bt.robot_model.payload import Payload, arm_payload, flange_of, payload
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
from bestman_bt.robot_model.urdf_tree import arm_of, joints_above

__all__ = [
    "ArmModel",
    "ArmPart",
    "BaseModel",
    "BasePart",
    "BatteryPart",
    "CameraPart",
    "EncodersConfig",
    "ForceTorquePart",
    "GripperModel",
    "GripperPart",
    "ImuPart",
    "JointGroupModel",
    "JointGroupPart",
    "JointLimitsConfig",
    "JointedModel",
    "LegModel",
    "LeggedBaseModel",
    "LeggedBasePart",
    "LidarPart",
    "MimicJoint",
    "MobilePart",
    "MountedBumper",
    "MountedForceTorque",
    "PartConfig",
    "Payload",
    "RobotModel",
    "SuctionPart",
    "TactilePart",
    "WheeledBaseModel",
    "arm_of",
    "arm_payload",
    "combine",
    "compose_robot",
    "flange_of",
    "joints_above",
    "load_robot_model",
    "payload",
]
