"""Bodies of people who walk: an upright cylinder on two slides, along x and along y, that motors move."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from bestman_bt.messages import Cylinder, PlacedShape, Pose
from bestman_bt.scene import Walker
from hal.pybullet.body_urdf import Color, body_urdf

COLOR: Color = (0.85, 0.45, 0.20, 1.0)
SLIDES = ("along_x", "along_y")
_ABOVE_FLOOR = 0.01
_CARRIER_MASS = 1.0  # of the first slide, without a shape
_REACH, _EFFORT, _VELOCITY = 30.0, 1000.0, 10.0  # URDF asks for limits


def walker_urdf(walker: Walker, folder: Path) -> str:
    """The slides are at 0 where the round begins; the cylinder does not touch the floor."""
    robot = ElementTree.Element("robot", name=walker.name)
    ElementTree.SubElement(robot, "link", name="world")
    robot.append(_carrier())
    shape = PlacedShape(
        Cylinder(walker.radius, walker.height - _ABOVE_FLOOR),
        Pose.from_xyz_rpy((0.0, 0.0, (walker.height + _ABOVE_FLOOR) / 2), (0.0, 0.0, 0.0)),
    )
    body = ElementTree.fromstring(body_urdf("body", walker.mass, [shape], [(shape, COLOR)], folder)).find("link")
    assert body is not None
    robot.append(body)
    for parent, child, slide, axis in (
        ("world", "carrier", SLIDES[0], "1 0 0"),
        ("carrier", "body", SLIDES[1], "0 1 0"),
    ):
        joint = ElementTree.SubElement(robot, "joint", name=slide, type="prismatic")
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=axis)
        limit = {"lower": str(-_REACH), "upper": str(_REACH), "effort": str(_EFFORT), "velocity": str(_VELOCITY)}
        ElementTree.SubElement(joint, "limit", limit)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _carrier() -> ElementTree.Element:
    link = ElementTree.Element("link", name="carrier")
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=str(_CARRIER_MASS))
    inertia = {"ixx": "0.01", "ixy": "0", "ixz": "0", "iyy": "0.01", "iyz": "0", "izz": "0.01"}
    ElementTree.SubElement(inertial, "inertia", inertia)
    return link
