"""The geometry of the legs of a base, from the URDF."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.model import LegModel
from bestman_bt.robot_model.part_config import LeggedBasePart
from bestman_bt.robot_model.urdf_elements import child_of

Places = dict[str, NDArray[np.float64]]


def legs(base: LeggedBasePart, urdf: ET.Element) -> tuple[LegModel, ...]:
    """Front right, front left, rear right, rear left."""
    child = {joint.get("name", ""): child_of(joint) for joint in urdf.findall("joint")}
    links = [child[joint] for joint in base.joints]
    poses = link_poses(list(urdf), {}, [base.root or "", *links, *base.feet])
    from_trunk = poses[base.root or ""].inverse()
    places = {link: (from_trunk @ pose).position for link, pose in poses.items()}
    return tuple(_leg(base, index, links[3 * index : 3 * index + 3], places) for index in range(len(base.feet)))


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
