"""A coarse bound on what an arm can reach: a hint before anything is computed, never a promise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree import ElementTree

if TYPE_CHECKING:
    from bestman_bt.robot_model import RobotModel


def highest_reach(robot: RobotModel) -> float:
    """Metres above the floor that no tool of the robot gets above: its joints' offsets and slides, outstretched."""
    from bestman_bt.robot_model import ArmModel

    above = {}
    for joint in ElementTree.fromstring(robot.urdf).iter("joint"):
        child = joint.find("child")
        if child is not None:
            above[child.get("link", "")] = joint
    heights = [0.0]
    for arm in robot.of(ArmModel).values():
        height, frame = 0.0, arm.tool_frame
        while frame != robot.base_frame and frame in above:
            joint = above[frame]
            height += _length(joint)
            parent = joint.find("parent")
            frame = "" if parent is None else parent.get("link", "")
        heights.append(height)
    return max(heights)


def widest_grasp(robot: RobotModel) -> float:
    """Metres between the fingers of the hand that opens widest; a suction cup has no such limit."""
    from bestman_bt.robot_model import GripperModel

    grippers = robot.of(GripperModel).values()
    return max((math.inf if gripper.part.kind == "suction" else gripper.max_width for gripper in grippers), default=0.0)


def _length(joint: ElementTree.Element) -> float:
    origin, limit = joint.find("origin"), joint.find("limit")
    offset = [float(number) for number in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()]
    slide = 0.0
    if joint.get("type") == "prismatic" and limit is not None:
        slide = max(abs(float(limit.get("lower", 0.0))), abs(float(limit.get("upper", 0.0))))
    return math.hypot(*offset) + slide
