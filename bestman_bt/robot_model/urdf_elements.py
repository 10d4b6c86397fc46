"""Small URDF elements: links with an inertial, shapes, joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

from bestman_bt.messages import Box, Cylinder, Shape, Sphere

TINY_MASS, TINY_INERTIA = 1e-3, 1e-6

Vector = Sequence[float]
ZERO = (0.0, 0.0, 0.0)


def numbers(values: Vector) -> str:
    """Numbers as URDF writes them."""
    return " ".join(f"{value:.9g}" for value in values)


def origin(xyz: Vector = ZERO, rpy: Vector = ZERO) -> ET.Element:
    """Return an ``<origin>``: metres, radians."""
    return ET.Element("origin", xyz=numbers(xyz), rpy=numbers(rpy))


def inertial(mass: float, moments: Vector, xyz: Vector = ZERO) -> ET.Element:
    """Return an ``<inertial>`` with a diagonal inertia ``moments`` (kg m²) about ``xyz``."""
    element = ET.Element("inertial")
    element.append(origin(xyz))
    ET.SubElement(element, "mass", value=f"{mass:.9g}")
    ixx, iyy, izz = (f"{moment:.9g}" for moment in moments)
    ET.SubElement(element, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    return element


def tiny_inertial() -> ET.Element:
    """Return a tiny inertial for frame links; without one, PyBullet gives them a kilogram."""
    return inertial(TINY_MASS, (TINY_INERTIA,) * 3)


def box_inertial(mass: float, size: Vector, xyz: Vector = ZERO) -> ET.Element:
    """Return the inertial of a homogeneous box of extents ``size`` centred at ``xyz``."""
    x, y, z = size
    return inertial(mass, (mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z), mass / 12 * (x * x + y * y)), xyz)


def shape(
    tag: str,
    geometry: Shape,
    xyz: Vector = ZERO,
    rpy: Vector = ZERO,
    rgba: Vector | None = None,
    material: str = "",
) -> ET.Element:
    """Return a ``<visual>`` or ``<collision>`` of a primitive; ``rgba`` colours it under the name ``material``."""
    element = ET.Element(tag)
    element.append(origin(xyz, rpy))
    holder = ET.SubElement(element, "geometry")
    match geometry:
        case Box():
            ET.SubElement(holder, "box", size=numbers(geometry.size))
        case Cylinder():
            ET.SubElement(holder, "cylinder", radius=f"{geometry.radius:.9g}", length=f"{geometry.length:.9g}")
        case Sphere():
            ET.SubElement(holder, "sphere", radius=f"{geometry.radius:.9g}")
        case _:
            raise TypeError(f"a URDF primitive should be a box, cylinder or sphere, got {type(geometry).__name__}")
    if rgba is not None:
        ET.SubElement(ET.SubElement(element, "material", name=material), "color", rgba=numbers(rgba))
    return element


def mesh_visual(
    filename: str, xyz: Vector = ZERO, rpy: Vector = ZERO, rgba: Vector = (0.7, 0.7, 0.7, 1.0), material: str = ""
) -> ET.Element:
    """Return a ``<visual>`` of a mesh file by its absolute path."""
    element = ET.Element("visual")
    element.append(origin(xyz, rpy))
    ET.SubElement(ET.SubElement(element, "geometry"), "mesh", filename=filename)
    ET.SubElement(ET.SubElement(element, "material", name=material), "color", rgba=numbers(rgba))
    return element


def link(name: str, *children: ET.Element) -> ET.Element:
    """Return a ``<link>``; one without an inertial gets a tiny one."""
    element = ET.Element("link", name=name)
    if not any(child.tag == "inertial" for child in children):
        element.append(tiny_inertial())
    element.extend(children)
    return element


def fixed_joint(name: str, parent: str, child: str, xyz: Vector = ZERO, rpy: Vector = ZERO) -> ET.Element:
    """Return a ``<joint type="fixed">``."""
    element = ET.Element("joint", name=name, type="fixed")
    element.append(origin(xyz, rpy))
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    return element


def turning_joint(
    name: str, parent: str, child: str, axis: Vector, xyz: Vector = ZERO, continuous: bool = False
) -> ET.Element:
    """Return a revolute or continuous joint; limits are written by the composer."""
    element = fixed_joint(name, parent, child, xyz)
    element.set("type", "continuous" if continuous else "revolute")
    ET.SubElement(element, "axis", xyz=numbers(axis))
    ET.SubElement(element, "limit", lower="0", upper="0", effort="1", velocity="1")
    return element


def sliding_joint(name: str, parent: str, child: str, axis: Vector, xyz: Vector = ZERO) -> ET.Element:
    """Return a prismatic joint; limits are written by the composer."""
    element = turning_joint(name, parent, child, axis, xyz)
    element.set("type", "prismatic")
    return element


def move_origin(elements: Iterable[ET.Element], link_name: str, to: Vector) -> None:
    """Move the frame of a link to ``to``, a point in it, without moving its children."""
    held = [e for e in elements if e.tag == "joint" and parent_of(e) == link_name]
    for element in elements:
        if element.tag == "link" and element.get("name") == link_name:
            held += [part for part in element if part.tag in ("visual", "collision", "inertial")]
    for element in held:
        place = element.find("origin")
        if place is None:
            place = ET.SubElement(element, "origin")
        before = [float(value) for value in place.get("xyz", "0 0 0").split()]
        place.set("xyz", numbers([value - moved for value, moved in zip(before, to, strict=True)]))


def parent_of(joint: ET.Element) -> str:
    """Return the link before a joint."""
    return _end(joint, "parent")


def joints_to(elements: Iterable[ET.Element]) -> dict[str, ET.Element]:
    """Return link → the joint that carries it, among the elements of a robot or of a part."""
    return {child_of(element): element for element in elements if element.tag == "joint"}


def child_of(joint: ET.Element) -> str:
    """Return the link behind a joint."""
    return _end(joint, "child")


def _end(joint: ET.Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")
