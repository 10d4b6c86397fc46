"""The robot model of a composed URDF: groups, frames, sensors, limits."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.footprint import footprint, origin_pose
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    JointGroupModel,
    LeggedBaseModel,
    LegModel,
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
from bestman_bt.robot_model.sensor_parts import BumperPart, ForceTorquePart, MountedBumper, MountedForceTorque
from bestman_bt.robot_model.urdf_elements import joints_to, parent_of

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
    """Return the model of ``urdf``; ``placed``: its parts by name, ``ignored_pairs``: excluded from collision
    checks.
    """
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
    """Return the part with its properties from the URDF, or None for a structure and for a bumper without a base, which
    the caller refuses. ``hand``: on an arm; ``before``: bases at least.
    """
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


def _joints_below(link: str, urdf: ET.Element) -> tuple[str, ...]:
    """Return the joints by which other links are attached to a link."""
    return tuple(joint.get("name", "") for joint in joints_to(urdf).values() if parent_of(joint) == link)


def _tool(config: object) -> str | None:
    """Return the grasp frame of a part, or None if it does not grasp."""
    return config.tool if isinstance(config, GripperPart | SuctionPart | JointGroupPart) else None


def _hands(urdf: ET.Element, placed: Mapping[str, PlacedPart]) -> dict[str, str]:
    """Return, by hand, the arm whose link carries it, directly or through other parts."""
    above = joints_to(urdf)
    arm_of_link = {link: p.name for p in placed.values() if isinstance(p.config, ArmPart) for link in p.links}
    hands = {}
    for part in placed.values():
        if _tool(part.config) is not None:
            link = part.root
            while link in above and link not in arm_of_link:
                link = parent_of(above[link])
            if link in arm_of_link:
                hands[part.name] = arm_of_link[link]
    return hands


def _pose(link: str, base_frame: str, above: Mapping[str, ET.Element]) -> Pose:
    """Return the pose of a link in the base frame, all joints at zero; on the floor below it for links that carry the
    base frame.
    """
    if link == base_frame or link not in above:
        return Pose()
    return _pose(parent_of(above[link]), base_frame, above) @ origin_pose(above[link])


def _footprint(
    urdf: ET.Element, base_frame: str, base: PlacedPart, placed: Mapping[str, PlacedPart]
) -> tuple[tuple[float, float], ...]:
    above = joints_to(urdf)
    rigid = set(base.links)
    for part in placed.values():
        if isinstance(part.config, StructurePart) and _rides_on(part.root, rigid, above):
            rigid |= set(part.links)
    links = [link for link in urdf.findall("link") if link.get("name", "") in rigid]
    return footprint(links, {link.get("name", ""): _pose(link.get("name", ""), base_frame, above) for link in links})


def _rides_on(link: str, rigid: set[str], above: Mapping[str, ET.Element]) -> bool:
    while link in above and above[link].get("type") == "fixed":
        link = parent_of(above[link])
        if link in rigid:
            return True
    return False


def _wheel_places(base: BasePart, urdf: ET.Element, base_frame: str) -> tuple[tuple[float, float], ...]:
    above = joints_to(urdf)
    wheel_of = {joint.get("name", ""): child for child, joint in above.items()}
    wheels = [_pose(wheel_of[joint], base_frame, above).position for joint in base.wheel_joints]
    return tuple((round(float(x), 6), round(float(y), 6)) for x, y, _ in wheels)


def _gripper(gripper: GripperPart, part: PlacedPart) -> GripperModel:
    return GripperModel(
        gripper,
        hand_link=part.root,
        opening=part.opening,
        followers=tuple(mimic for mimic in part.mimics if mimic.joint not in gripper.joints),
        linkage=tuple(link for link in part.links if link not in (part.root, gripper.tool, *gripper.finger_links)),
    )


def mounted_bumper(bumper: BumperPart, base: BaseModel) -> MountedBumper:
    """Return the zones of a bumper: strips of equal length, counter-clockwise from the front right corner."""
    joints = base.part.driven_joints if isinstance(base, WheeledBaseModel) else ()
    corners = np.array(base.footprint)
    begin = int(np.argmin(np.abs(np.arctan2(corners[:, 1], corners[:, 0]) + math.pi / 4)))
    outline = np.vstack([np.roll(corners, -begin, axis=0), corners[begin]])
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1)))
    marks = np.linspace(0.0, lengths[-1], bumper.zones + 1)
    ends = np.column_stack([np.interp(marks, lengths, outline[:, axis]) for axis in (0, 1)])
    zones = tuple((_pair(start), _pair(end)) for start, end in itertools.pairwise(ends))
    return MountedBumper(bumper, joints, zones)


def _pair(point: NDArray[np.float64]) -> tuple[float, float]:
    return round(float(point[0]), 4), round(float(point[1]), 4)


Places = dict[str, NDArray[np.float64]]


def legs(base: LeggedBasePart, urdf: ET.Element) -> tuple[LegModel, ...]:
    """Return the legs: front right, front left, rear right, rear left."""
    child = {joint.get("name", ""): link for link, joint in joints_to(urdf).items()}
    links = [child[joint] for joint in base.joints]
    poses = link_poses(list(urdf), {}, [base.root or "", *links, *base.feet])
    from_trunk = poses[base.root or ""].inverse()
    places = {link: (from_trunk @ pose).position for link, pose in poses.items()}
    return tuple(_leg(base, index, links[3 * index : 3 * index + 3], places) for index in range(len(base.feet)))


def _leg(base: LeggedBasePart, index: int, links: list[str], places: Places) -> LegModel:
    hip, thigh, knee = (places[link] for link in links)
    foot = places[base.feet[index]]
    x, y, z = hip.tolist()
    return LegModel(
        hip=(x, y, z),
        thigh_offset=float(thigh[1] - hip[1]),
        thigh_length=float(thigh[2] - knee[2]),
        calf_length=float(knee[2] - foot[2]),
    )


def allowed_self_pairs(
    robot: ET.Element, locked_joints: frozenset[str], declared: Iterable[tuple[str, str]]
) -> frozenset[frozenset[str]]:
    """Return the pairs of links with collision shapes that need no check.

    These are links connected rigidly or by ``locked_joints`` (wheels), a link and its nearest ancestor with a shape,
    and the ``declared`` pairs.
    """
    solid = {link.get("name", "") for link in robot.findall("link") if link.find("collision") is not None}
    above = joints_to(robot)
    locked = {
        link for link, joint in above.items() if joint.get("type") == "fixed" or joint.get("name") in locked_joints
    }
    pairs = {frozenset(pair) for pair in declared}
    groups: dict[str, list[str]] = {}
    for link in sorted(solid):
        groups.setdefault(_group(link, above, locked), []).append(link)
        neighbour = _solid_ancestor(link, above, solid)
        if neighbour is not None:
            pairs.add(frozenset((link, neighbour)))
    for members in groups.values():
        pairs.update(frozenset(pair) for pair in combinations(members, 2))
    return frozenset(pair for pair in pairs if len(pair) == 2 and pair <= solid)


def _group(link: str, above: Mapping[str, ET.Element], locked: set[str]) -> str:
    while link in locked:
        link = parent_of(above[link])
    return link


def _solid_ancestor(link: str, above: Mapping[str, ET.Element], solid: set[str]) -> str | None:
    while link in above:
        link = parent_of(above[link])
        if link in solid:
            return link
    return None
