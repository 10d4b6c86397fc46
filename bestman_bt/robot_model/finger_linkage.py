"""Fingers on a linkage: the opening width as a function of the driven joints."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.footprint import origin_pose, outline
from bestman_bt.robot_model.urdf_elements import joints_to, parent_of

SAMPLES = 17


@dataclass(frozen=True)
class MimicJoint:
    """A joint that a mechanism couples to another: its position is ``multiplier`` × the leader's + ``offset``."""

    joint: str
    leader: str
    multiplier: float = 1.0
    offset: float = 0.0


def all_positions(driven: Mapping[str, float], mimics: Iterable[MimicJoint]) -> dict[str, float]:
    """Return the positions of driven joints and of all joints that mimic them, directly or indirectly."""
    positions = dict(driven)
    waiting = list(mimics)
    while waiting:
        later = []
        for mimic in waiting:
            if mimic.leader in positions:
                positions[mimic.joint] = mimic.multiplier * positions[mimic.leader] + mimic.offset
            else:
                later.append(mimic)
        if len(later) == len(waiting):
            break
        waiting = later
    return positions


def opening_table(
    elements: list[ET.Element],
    joints: tuple[str, ...],
    mimics: tuple[MimicJoint, ...],
    fingers: tuple[str, ...],
    tool: str,
    travel: tuple[float, float],
    min_width: float,
) -> tuple[tuple[float, float], ...]:
    """Return pairs (position of each of ``joints``, opening width), from the widest to the closed hand.

    ``travel``: the position where the hand is open, and where it is closed to ``min_width``. The width is that of the
    gap between the middles of the first two ``fingers`` along y of the frame ``tool``, by forward kinematics; pads do
    not rotate in a parallel hand, so their thickness is constant.
    """
    middles = [_middle(elements, finger) for finger in fingers[:2]]
    opened, closed = travel
    gaps = []
    positions = np.linspace(opened, closed, SAMPLES)
    for position in positions:
        poses = link_poses(elements, all_positions(dict.fromkeys(joints, float(position)), mimics), (tool, *fingers))
        in_tool = poses[tool].inverse()
        first, second = (
            (in_tool @ poses[finger]).apply(middle)[1] for finger, middle in zip(fingers[:2], middles, strict=True)
        )
        gaps.append(abs(float(first - second)))
    return tuple((float(q), gap - gaps[-1] + min_width) for q, gap in zip(positions, gaps, strict=True))


def link_poses(elements: list[ET.Element], positions: Mapping[str, float], links: Iterable[str]) -> dict[str, Pose]:
    """Return link → pose in the root link's frame, at least for ``links``; joints without a position are at zero."""
    joints = joints_to(elements)
    poses: dict[str, Pose] = {}

    def pose(link: str) -> Pose:
        if link not in poses:
            joint = joints.get(link)
            poses[link] = Pose() if joint is None else pose(parent_of(joint)) @ joint_pose(joint, positions)
        return poses[link]

    for link in links:
        pose(link)
    return poses


def _middle(elements: list[ET.Element], link: str) -> NDArray[np.float64]:
    """Return the mean of the corners of a link's collision shapes, (3,) metres in its frame; its origin if it has
    none.
    """
    found = next(element for element in elements if element.tag == "link" and element.get("name") == link)
    clouds = [
        origin_pose(collision).apply(outline(collision.find("geometry"))) for collision in found.findall("collision")
    ]
    points = np.concatenate([np.zeros((0, 3)), *clouds])
    return points.mean(axis=0) if len(points) else np.zeros(3)


def joint_pose(joint: ET.Element, positions: Mapping[str, float]) -> Pose:
    """Return the pose of a joint's child link in its parent link; missing joints are at zero."""
    placed = origin_pose(joint)
    position = positions.get(joint.get("name", ""), 0.0)
    if position == 0.0 or joint.get("type") == "fixed":
        return placed
    element = joint.find("axis")
    axis = np.array((element.get("xyz", "1 0 0") if element is not None else "1 0 0").split(), dtype=float)
    axis /= np.linalg.norm(axis)
    if joint.get("type") == "prismatic":
        return placed @ Pose(axis * position)
    half = position / 2.0
    return placed @ Pose(np.zeros(3), np.array([*(axis * math.sin(half)), math.cos(half)]))
