"""URDF in which links that fixed joints hold together are one: a simulator pays for each link in every step."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.bare_frames import Places
from bestman_bt.robot_model.footprint import origin_pose

Array = NDArray[np.float64]


def with_rigid_links_merged(urdf: str, keep: Collection[str]) -> tuple[str, Places]:
    """``urdf`` with each link on a fixed joint made part of the link above it, but for ``keep``; and where it is now.

    Shapes, mass, centre of mass and inertia of the whole are those of the parts. A link without a mass stays as it is.
    """
    robot = ET.fromstring(urdf)
    links = {link.get("name", ""): link for link in robot.findall("link")}
    places: Places = {}
    for joint in robot.findall("joint"):
        name, above = _end(joint, "child"), _end(joint, "parent")
        if joint.get("type") != "fixed" or name in keep:
            continue
        if links[name].find("inertial") is None or links[above].find("inertial") is None:
            continue
        pose = origin_pose(joint)
        _merge(links[above], links[name], pose)
        robot.remove(joint)
        robot.remove(links[name])
        for below in robot.findall("joint"):
            if _end(below, "parent") == name:
                _set_parent(below, above, pose @ origin_pose(below))
        for frame, (holder, holder_from_frame) in places.items():
            if holder == name:
                places[frame] = (above, pose @ holder_from_frame)
        places[name] = (above, pose)
    return ET.tostring(robot, encoding="unicode"), places


def _merge(above: ET.Element, link: ET.Element, above_from_link: Pose) -> None:
    for tag in ("visual", "collision"):
        for element in link.findall(tag):
            _set_origin(element, above_from_link @ origin_pose(element))
            above.append(element)
    whole = _inertial(above)
    mass, centre, inertia = _inertial(link)
    centre, turned = above_from_link.apply(centre), above_from_link.rotation
    total = whole[0] + mass
    middle = (whole[0] * whole[1] + mass * centre) / total
    about = _about(whole[2], whole[0], whole[1] - middle) + _about(turned @ inertia @ turned.T, mass, centre - middle)
    _set_inertial(above, total, middle, about)


def _about(inertia: Array, mass: float, offset: Array) -> Array:
    """The inertia (3, 3) about a point away from the centre of mass (Steiner)."""
    return inertia + mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def _inertial(link: ET.Element) -> tuple[float, Array, Array]:
    """Mass, centre (3,) and inertia (3, 3) about the centre, in the link's axes."""
    element = link.find("inertial")
    assert element is not None
    mass, terms = element.find("mass"), element.find("inertia")
    assert mass is not None
    assert terms is not None
    pose = origin_pose(element)
    upper = {key: float(terms.get(f"i{key}", "0")) for key in ("xx", "xy", "xz", "yy", "yz", "zz")}
    inertia = np.array([[upper["".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
    return float(mass.get("value", "0")), pose.position, pose.rotation @ inertia @ pose.rotation.T


def _set_inertial(link: ET.Element, mass: float, centre: Array, inertia: Array) -> None:
    element = link.find("inertial")
    assert element is not None
    element.clear()
    _set_origin(element, Pose(centre))
    ET.SubElement(element, "mass", value=repr(float(mass)))
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    ET.SubElement(element, "inertia", {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j])) for i, j in pairs})


def _set_parent(joint: ET.Element, link: str, pose: Pose) -> None:
    parent = joint.find("parent")
    assert parent is not None
    parent.set("link", link)
    _set_origin(joint, pose)


def _set_origin(element: ET.Element, pose: Pose) -> None:
    origin = element.find("origin")
    if origin is None:
        origin = ET.SubElement(element, "origin")
    origin.set("xyz", " ".join(repr(float(value)) for value in pose.position))
    origin.set("rpy", " ".join(map(repr, pose.roll_pitch_yaw)))


def _end(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")
