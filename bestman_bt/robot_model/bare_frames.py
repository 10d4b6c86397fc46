"""URDF without links that are mere frames: a simulator pays for each of them in every step."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from bestman_bt.messages import Pose
from bestman_bt.robot_model.footprint import origin_pose
from bestman_bt.robot_model.urdf_elements import child_of, parent_of

Places = dict[str, tuple[str, Pose]]
"""Frame → (link that it is fixed to, link_from_frame)."""


def without_bare_frames(urdf: str) -> tuple[str, Places]:
    """``urdf`` without the links that have no shape and hang on a fixed joint, and where these frames are.

    What hung on such a link then hangs on the link before it. Their masses go: RobotModel gives frames tiny ones.
    """
    robot = ET.fromstring(urdf)
    joint_above = {child_of(joint): joint for joint in robot.findall("joint")}
    above: Places = {}
    for link in robot.findall("link"):
        name = link.get("name", "")
        joint = joint_above.get(name)
        has_shape = link.find("collision") is not None or link.find("visual") is not None
        if joint is not None and joint.get("type") == "fixed" and not has_shape:
            above[name] = (parent_of(joint), origin_pose(joint))
            robot.remove(link)
            robot.remove(joint)
    places = {name: _place(name, above) for name in above}
    for joint in robot.findall("joint"):
        parent = joint.find("parent")
        if parent is not None and parent.get("link", "") in places:
            link_name, link_from_frame = places[parent.get("link", "")]
            parent.set("link", link_name)
            _move(joint, link_from_frame @ origin_pose(joint))
    return ET.tostring(robot, encoding="unicode"), places


def _place(name: str, above: Places) -> tuple[str, Pose]:
    link, pose = above[name]
    while link in above:
        link, link_from_previous = above[link]
        pose = link_from_previous @ pose
    return link, pose


def _move(joint: ET.Element, pose: Pose) -> None:
    origin = joint.find("origin")
    if origin is None:
        origin = ET.SubElement(joint, "origin")
    origin.set("xyz", " ".join(repr(float(value)) for value in pose.position))
    origin.set("rpy", " ".join(map(repr, pose.roll_pitch_yaw)))
