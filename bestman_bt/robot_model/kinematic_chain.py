"""Which joints carry a frame."""

from __future__ import annotations

from xml.etree import ElementTree

from bestman_bt.robot_model.model import RobotModel


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
