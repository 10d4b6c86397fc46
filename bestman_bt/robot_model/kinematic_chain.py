"""Which joints, and which arm, carry a frame."""

from __future__ import annotations

from xml.etree import ElementTree

from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart, ImuPart, LidarPart, MountedForceTorque, TactilePart


def joints_above(model: RobotModel, frame: str) -> frozenset[str]:
    """Names of all joints between the robot's root and ``frame``; empty for the root or an unknown frame."""
    above = {}
    for joint in ElementTree.fromstring(model.urdf).iter("joint"):
        child, parent = joint.find("child"), joint.find("parent")
        if child is not None and parent is not None:
            above[child.get("link", "")] = (joint.get("name", ""), parent.get("link", ""))
    joints = set()
    while frame in above:
        name, frame = above[frame]
        joints.add(name)
    return frozenset(joints)


def arm_of(model: RobotModel, part: str) -> str | None:
    """The arm that a part is or that carries it; None for parts that no arm moves. KeyError for an unknown part."""
    if part in model.arm_names:
        return part
    if part in model.hand_of:
        return model.hand_of[part]
    mounted = model.parts[part]
    if not isinstance(mounted, CameraPart | ImuPart | LidarPart | MountedForceTorque | TactilePart):
        return None
    frame = mounted.part.frame if isinstance(mounted, MountedForceTorque) else mounted.frame
    joints = joints_above(model, frame)
    return next((name for name, arm in model.of(ArmModel).items() if joints & set(arm.joint_names)), None)
