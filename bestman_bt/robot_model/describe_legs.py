"""The model of a legged base: the geometry of its legs from the URDF."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.model import BaseModel, LegModel
from bestman_bt.robot_model.part_config import LeggedBasePart
from bestman_bt.robot_model.urdf_elements import child_of

Places = dict[str, NDArray[np.float64]]


def legged_base_model(
    base: LeggedBasePart, frame: str, outline: tuple[tuple[float, float], ...], urdf: ET.Element
) -> BaseModel:
    """``frame``: the link on the floor below the trunk; ``outline``: the footprint."""
    child = {joint.get("name", ""): child_of(joint) for joint in urdf.findall("joint")}
    links = [child[joint] for joint in base.joints]
    poses = link_poses(list(urdf), {}, [base.root or "", *links, *base.feet])
    from_trunk = poses[base.root or ""].inverse()
    places = {link: (from_trunk @ pose).position for link, pose in poses.items()}
    return BaseModel(
        kind="legged",
        frame=frame,
        wheel_joints=(),
        wheel_radius=0.0,
        track=0.0,
        wheel_torque=0.0,
        caster_links=(),
        max_vx=base.max_vx,
        max_vy=base.max_vy,
        max_wz=base.max_wz,
        max_acceleration=base.max_acceleration,
        max_angular_acceleration=base.max_angular_acceleration,
        max_jerk=base.max_jerk,
        max_angular_jerk=base.max_angular_jerk,
        footprint=outline,
        wheel_friction=base.foot_friction,
        legs=tuple(_leg(base, index, links[3 * index : 3 * index + 3], places) for index in range(len(base.feet))),
        trunk_link=base.root or "",
        stand_height=base.stand_height,
    )


def _leg(base: LeggedBasePart, index: int, links: list[str], places: Places) -> LegModel:
    hip, thigh, knee = (places[link] for link in links)
    foot, rows, limits = places[base.feet[index]], slice(3 * index, 3 * index + 3), base.limits
    first, second, third = base.joints[rows]
    x, y, z = hip.tolist()
    return LegModel(
        joint_names=(first, second, third),
        foot_link=base.feet[index],
        hip=(x, y, z),
        thigh_offset=float(thigh[1] - hip[1]),
        thigh_length=float(thigh[2] - knee[2]),
        calf_length=float(knee[2] - foot[2]),
        foot_radius=base.foot_radius,
        lower=limits.lower[rows],
        upper=limits.upper[rows],
        velocity=limits.velocity[rows],
        effort=limits.effort[rows],
    )
