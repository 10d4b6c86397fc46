"""The joint limits of a composed URDF: those of the descriptions of its parts, whatever the source says."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from bestman_bt.robot_model.finger_linkage import all_positions
from bestman_bt.robot_model.part_config import BasePart, GripperPart, JointedPart, JointGroupPart
from bestman_bt.robot_model.placed_part import PlacedPart

FOLLOWER_SLACK = 0.1


def write_limits(part: PlacedPart) -> None:
    """The URDF's own joint limits become those of the part's description."""
    config = part.config
    limits: dict[str, tuple[float, float, float, float]] = {}  # lower, upper, velocity, effort
    if isinstance(config, JointedPart):
        each = config.limits
        rows = zip(each.lower, each.upper, each.velocity, each.effort, strict=True)
        limits = dict(zip(config.joints, rows, strict=True))
    elif isinstance(config, GripperPart):
        limits = _gripper_limits(part, config)
    elif isinstance(config, BasePart):
        speed = (config.max_vx + config.max_wz * config.track / 2) / config.wheel_radius
        limits = dict.fromkeys(config.wheel_joints, (0.0, -1.0, speed, config.wheel_torque))
        steering = (0.0, -1.0, config.steering_speed, config.steering_torque)
        limits |= dict.fromkeys(config.steering_joints, steering)
    for element in part.elements:
        row_or_none = limits.get(element.get("name", "")) if element.tag == "joint" else None
        if row_or_none is None:
            continue
        if isinstance(config, JointGroupPart):
            # Hands come with dampings far beyond what their light links can take in a step of a simulation.
            for dynamics in element.findall("dynamics"):
                element.remove(dynamics)
        limit = element.find("limit")
        limit = ET.SubElement(element, "limit") if limit is None else limit
        lower, upper, velocity, effort = row_or_none
        if element.get("type") == "continuous" and isinstance(config, JointedPart):
            element.set("type", "revolute")  # its description says how far the cables let it turn
        if element.get("type") == "continuous":
            limit.attrib.pop("lower", None)
            limit.attrib.pop("upper", None)
        else:
            limit.set("lower", f"{lower:.9g}")
            limit.set("upper", f"{upper:.9g}")
        limit.set("velocity", f"{velocity:.9g}")
        limit.set("effort", f"{effort:.9g}")


def _gripper_limits(part: PlacedPart, config: GripperPart) -> dict[str, tuple[float, float, float, float]]:
    """Of the joints that drive the fingers: by the widths, the speed and the force of the hand."""
    n = len(config.joints)
    if not part.opening:
        row = (config.min_width / n, config.max_width / n, config.max_speed / n, config.max_force)
        return dict.fromkeys(config.joints, row)
    positions, widths = np.array(part.opening).T
    per_metre = np.abs(np.diff(positions) / np.diff(widths))
    speed, effort = float(per_metre.max() * config.max_speed), float(config.max_force / (n * per_metre.min()))
    ends = [
        all_positions(dict.fromkeys(config.joints, float(end)), part.mimics)
        for end in (positions.min(), positions.max())
    ]
    limits = {}
    for joint in ends[0]:
        lower, upper = sorted(end[joint] for end in ends)
        # Gears give a little: those that follow must not strike a limit before the one that leads.
        slack = 0.0 if joint in config.joints else FOLLOWER_SLACK
        limits[joint] = (lower - slack, upper + slack, speed, effort)
    return limits
