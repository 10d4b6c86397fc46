"""Robots composed from parts: one URDF with groups, frames, sensors and postures."""

from bestman_bt.robot_model.combination import combine
from bestman_bt.robot_model.compose import compose_robot, load_robot_model
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.kinematic_chain import joints_above
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    JointGroupModel,
    LegModel,
    RobotModel,
)
from bestman_bt.robot_model.payload import Payload, payload
from bestman_bt.robot_model.sensor_models import (
    BatteryModel,
    BumperModel,
    CameraModel,
    EncoderModel,
    ForceTorqueModel,
    ImuModel,
    LidarModel,
    TactileModel,
)

__all__ = [
    "ArmModel",
    "BaseModel",
    "BatteryModel",
    "BumperModel",
    "CameraModel",
    "EncoderModel",
    "ForceTorqueModel",
    "GripperModel",
    "ImuModel",
    "JointGroupModel",
    "LegModel",
    "LidarModel",
    "MimicJoint",
    "Payload",
    "RobotModel",
    "TactileModel",
    "combine",
    "compose_robot",
    "joints_above",
    "load_robot_model",
    "payload",
]
