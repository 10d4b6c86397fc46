"""The payload of a link: mass and centre of everything beyond it, from the URDF's inertials."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.finger_linkage import joint_pose
from bestman_bt.robot_model.footprint import origin_pose
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.urdf_elements import joints_to, parent_of


@dataclass(frozen=True, eq=False)
class Payload:
    """``mass``, kg, and ``centre`` of mass (3,), metres, in the frame of the link that carries it."""

    mass: float
    centre: NDArray[np.float64]


def payload(model: RobotModel, link: str, positions: Mapping[str, float] | None = None) -> Payload:
    """Return the mass of ``link`` and everything beyond it, with joints at ``positions`` by name, others at zero.

    Joints of a parallel hand open symmetrically and do not move the centre.
    """
    robot = ET.fromstring(model.urdf)
    children = _children(robot, positions or {})
    inertials = {element.get("name", ""): element.find("inertial") for element in robot.findall("link")}
    mass, moment = 0.0, np.zeros(3)
    beyond = [(link, Pose())]
    while beyond:
        name, from_link = beyond.pop()
        inertial = inertials.get(name)
        weighed = None if inertial is None else inertial.find("mass")
        if inertial is not None and weighed is not None:
            own = float(weighed.get("value", "0"))
            mass += own
            moment += own * (from_link @ origin_pose(inertial)).position
        beyond += [(child, from_link @ from_parent) for child, from_parent in children.get(name, ())]
    return Payload(mass, moment / mass if mass > 0.0 else moment)


def arm_payload(
    model: RobotModel, arm: str, mass: float = 0.0, centre: ArrayLike = (0.0, 0.0, 0.0), hand: Payload | None = None
) -> Payload:
    """Return the payload of an arm's flange: its hand, and an object of ``mass`` kg with its ``centre`` in the tool
    frame.

    ``hand``: permanent payload in the flange's frame; by default from the URDF's inertials.
    """
    flange = flange_of(model, arm)
    hand = hand or payload(model, flange)
    children = _children(ET.fromstring(model.urdf), {})
    beyond = [(flange, Pose())]
    while beyond:
        name, from_flange = beyond.pop()
        if name == model.of(ArmModel)[arm].tool_frame:
            held = (from_flange @ Pose(np.asarray(centre, float))).position
            whole = hand.mass + mass
            return Payload(whole, (hand.mass * hand.centre + mass * held) / whole if whole > 0.0 else held)
        beyond += [(child, from_flange @ from_parent) for child, from_parent in children.get(name, ())]
    return hand


def flange_of(model: RobotModel, arm: str) -> str:
    """Return the link that carries the hand of an arm: the tip of its part."""
    return model.of(ArmModel)[arm].part.tip


def _children(robot: ET.Element, positions: Mapping[str, float]) -> dict[str, list[tuple[str, Pose]]]:
    """Return, by link, its child links and their poses in it."""
    children: dict[str, list[tuple[str, Pose]]] = {}
    for child, joint in joints_to(robot).items():
        children.setdefault(parent_of(joint), []).append((child, joint_pose(joint, positions)))
    return children
