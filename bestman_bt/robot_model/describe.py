"""The robot model of a composed URDF: groups, frames, sensors, limits."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from bestman_bt.messages import Pose
from bestman_bt.robot_model.bumper_ring import mounted_bumper
from bestman_bt.robot_model.describe_legs import legs
from bestman_bt.robot_model.footprint import footprint, origin_pose
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    JointGroupModel,
    LeggedBaseModel,
    Part,
    RobotModel,
    WheeledBaseModel,
)
from bestman_bt.robot_model.part_config import (
    ArmPart,
    BasePart,
    GripperPart,
    JointGroupPart,
    LeggedBasePart,
    StructurePart,
    SuctionPart,
)
from bestman_bt.robot_model.part_fields import PartConfig
from bestman_bt.robot_model.placed_part import PlacedPart
from bestman_bt.robot_model.self_pairs import allowed_self_pairs
from bestman_bt.robot_model.sensor_parts import (
    BumperPart,
    ForceTorquePart,
    MountedForceTorque,
)

_ORDER = (
    *("base", "legged_base", "structure", "arm", "gripper", "suction", "joint_group"),
    *("camera", "lidar", "force_torque", "imu", "tactile", "bumper", "battery"),
)
"""Kinds in the order of ``RobotModel.parts``; those of plug-ins come last."""


def describe(
    name: str,
    urdf: ET.Element,
    base_frame: str,
    placed: Mapping[str, PlacedPart],
    postures: Mapping[str, Mapping[str, float]],
    ignored_pairs: list[tuple[str, str]],
) -> RobotModel:
    """The model of ``urdf``; ``placed``: its parts by name, ``ignored_pairs``: links that need no collision check."""
    hand_of = _hands(urdf, placed)
    tools = {arm: placed[gripper].config for gripper, arm in hand_of.items()}
    wheels = frozenset(
        joint
        for part in placed.values()
        if isinstance(part.config, BasePart)
        for joint in (*part.config.wheel_joints, *part.config.steering_joints)
    )
    parts: dict[str, Part] = {}
    order = {kind: index for index, kind in enumerate(_ORDER)}
    for part_name, part in sorted(placed.items(), key=lambda item: order.get(item[1].config.kind, len(order))):
        resolved = _resolve(part, urdf, base_frame, placed, tools.get(part_name), parts)
        if resolved is not None:
            parts[part_name] = resolved
    return RobotModel(
        name=name,
        urdf=ET.tostring(urdf, encoding="unicode"),
        base_frame=base_frame,
        parts=parts,
        postures=postures,
        hand_of=hand_of,
        allowed_self_pairs=allowed_self_pairs(urdf, wheels, ignored_pairs),
    )


def _resolve(
    part: PlacedPart,
    urdf: ET.Element,
    base_frame: str,
    placed: Mapping[str, PlacedPart],
    hand: PartConfig | None,
    before: Mapping[str, Part],
) -> Part | None:
    """The part with what the URDF adds to it; None for a structure. ``hand``: on an arm; ``before``: bases at least."""
    match part.config:
        case BasePart() as base:
            outline = _footprint(urdf, base_frame, part, placed)
            return WheeledBaseModel(base, part.root, outline, _wheel_places(base, urdf, base_frame))
        case LeggedBasePart() as walker:
            return LeggedBaseModel(walker, part.root, _footprint(urdf, base_frame, part, placed), legs(walker, urdf))
        case ArmPart() as arm:
            return ArmModel(arm, part.root, _tool(hand) or arm.tip)
        case GripperPart() as gripper:
            return _gripper(gripper, part)
        case SuctionPart() as cup:
            return GripperModel(cup, part.root)
        case JointGroupPart() as group:
            return JointGroupModel(group)
        case ForceTorquePart() as sensor:
            return MountedForceTorque(sensor, _joints_below(sensor.frame, urdf))
        case BumperPart() as ring:
            return next((mounted_bumper(ring, base) for base in before.values() if isinstance(base, BaseModel)), None)
        case StructurePart():
            return None
        case sensor:
            return sensor


def _joint_parents(urdf: ET.Element) -> dict[str, tuple[str, ET.Element]]:
    """Child link → its parent link and the joint between them."""
    parents = {}
    for joint in urdf.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            parents[child.get("link", "")] = (parent.get("link", ""), joint)
    return parents


def _joints_below(link: str, urdf: ET.Element) -> tuple[str, ...]:
    """Names of the joints by which other links hang on a link."""
    return tuple(joint.get("name", "") for parent, joint in _joint_parents(urdf).values() if parent == link)


def _tool(config: object) -> str | None:
    """Where a part grasps; None for one that does not."""
    return config.tool if isinstance(config, GripperPart | SuctionPart | JointGroupPart) else None


def _hands(urdf: ET.Element, placed: Mapping[str, PlacedPart]) -> dict[str, str]:
    """Hand → the arm whose link carries it, directly or through other parts."""
    parents = _joint_parents(urdf)
    arm_of_link = {link: p.name for p in placed.values() if isinstance(p.config, ArmPart) for link in p.links}
    hands = {}
    for part in placed.values():
        if _tool(part.config) is not None:
            link = part.root
            while link in parents and link not in arm_of_link:
                link = parents[link][0]
            if link in arm_of_link:
                hands[part.name] = arm_of_link[link]
    return hands


def _pose(link: str, base_frame: str, parents: Mapping[str, tuple[str, ET.Element]]) -> Pose:
    """Of a link in the base frame, all joints at zero; on the floor below it for links that carry the base frame."""
    if link == base_frame or link not in parents:
        return Pose()
    parent, joint = parents[link]
    return _pose(parent, base_frame, parents) @ origin_pose(joint)


def _footprint(
    urdf: ET.Element, base_frame: str, base: PlacedPart, placed: Mapping[str, PlacedPart]
) -> tuple[tuple[float, float], ...]:
    parents = _joint_parents(urdf)
    rigid = set(base.links)
    for part in placed.values():
        if isinstance(part.config, StructurePart) and _rides_on(part.root, rigid, parents):
            rigid |= set(part.links)
    links = [link for link in urdf.findall("link") if link.get("name", "") in rigid]
    return footprint(links, {link.get("name", ""): _pose(link.get("name", ""), base_frame, parents) for link in links})


def _rides_on(link: str, rigid: set[str], parents: Mapping[str, tuple[str, ET.Element]]) -> bool:
    while link in parents and parents[link][1].get("type") == "fixed":
        link = parents[link][0]
        if link in rigid:
            return True
    return False


def _wheel_places(base: BasePart, urdf: ET.Element, base_frame: str) -> tuple[tuple[float, float], ...]:
    parents = _joint_parents(urdf)
    wheel_of = {joint.get("name", ""): child for child, (_, joint) in parents.items()}
    wheels = [_pose(wheel_of[joint], base_frame, parents).position for joint in base.wheel_joints]
    return tuple((round(float(x), 6), round(float(y), 6)) for x, y, _ in wheels)


def _gripper(gripper: GripperPart, part: PlacedPart) -> GripperModel:
    return GripperModel(
        gripper,
        hand_link=part.root,
        opening=part.opening,
        followers=tuple(mimic for mimic in part.mimics if mimic.joint not in gripper.joints),
        linkage=tuple(link for link in part.links if link not in (part.root, gripper.tool, *gripper.finger_links)),
    )
