"""Small URDF elements: links with an inertial, shapes and joints, and checks of the elements in a file."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from bestman_bt.messages import Box, Cylinder, Shape, Sphere
from bestman_bt.registry import suggestion

TINY_MASS, TINY_INERTIA = 1e-3, 1e-6

Vector = Sequence[float]
ZERO = (0.0, 0.0, 0.0)


def numbers(values: Vector) -> str:
    """Format numbers for URDF, separated by spaces."""
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
    """Return the inertial of a homogeneous box: ``mass``, kg, extents ``size``, centred at ``xyz``, metres."""
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


def mesh_visual(filename: str, rpy: Vector, rgba: Vector, material: str) -> ET.Element:
    """Return a ``<visual>`` of a mesh file by its absolute path."""
    element = ET.Element("visual")
    element.append(origin(ZERO, rpy))
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
    """Return the parent link of a joint."""
    return _end(joint, "parent")


def joints_to(elements: Iterable[ET.Element]) -> dict[str, ET.Element]:
    """Return link → the joint that carries it, among the elements of a robot or of a part."""
    return {child_of(element): element for element in elements if element.tag == "joint"}


def child_of(joint: ET.Element) -> str:
    """Return the child link of a joint."""
    return _end(joint, "child")


def _end(joint: ET.Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


_JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed")
_THREE = {"origin": ("xyz", "rpy"), "axis": ("xyz",), "box": ("size",), "mesh": ("scale",)}
_ONE = {
    "limit": ("lower", "upper", "effort", "velocity"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "mimic": ("multiplier", "offset"),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
}
_MEND = "cut the link behind it, or correct the file"


def structure_faults(robot: ET.Element) -> list[str]:
    """Return why links and joints do not form a tree with one root: duplicate names, missing links, cycles."""
    links = [link.get("name", "") for link in robot.findall("link")]
    joints = robot.findall("joint")
    faults = [f"link {name!r} is defined twice" for name in _twice(links)]
    faults += [f"joint {name!r} is defined twice" for name in _twice(joint.get("name", "") for joint in joints)]
    for joint in joints:
        for what, link in (("parent", parent_of(joint)), ("child", child_of(joint))):
            if link not in links:
                hint = suggestion(link, links)
                faults.append(f"the {what} of joint {joint.get('name')!r} is {link!r}, which is not a link; {hint}")
    held_twice = _twice(child_of(joint) for joint in joints)
    if held_twice:
        faults.append(f"is not a tree: {', '.join(held_twice)} is the child of two joints")
    carried = {child_of(joint) for joint in joints}
    roots = [name for name in dict.fromkeys(links) if name not in carried]
    if not roots:
        faults.append("has no root link: its joints form a cycle" if links else "has no links")
    elif len(roots) > 1:
        faults.append(f"should have one root link, it has {', '.join(roots)}")
    elif not faults:
        reached = _reached(roots[0], joints)
        lost = [name for name in links if name not in reached]
        if lost:
            faults.append(f"is not connected: {', '.join(lost)} form a cycle")
    return faults


def value_faults(elements: Iterable[ET.Element]) -> list[str]:
    """Return invalid numbers, negative masses, unsupported joint types, and mimic joints without a leader."""
    elements = list(elements)
    faults: list[str] = []
    joints = {element.get("name", "") for element in elements if element.tag == "joint"}
    for element in elements:
        what = f"{element.tag} {element.get('name')!r}"
        faults += [f"{what} {fault}: {_MEND}" for fault in _number_faults(element)]
        for mass in element.findall("inertial/mass"):
            if _is_numbers(mass.get("value", "0"), 1) and float(mass.get("value", "0")) < 0.0:
                faults.append(f"{what} has the mass {mass.get('value')} kg: it should not be negative")
        if element.tag == "joint":
            kind = element.get("type", "")
            if kind not in _JOINT_TYPES:
                faults.append(f"{what} is {kind or 'of no type'}: only {', '.join(_JOINT_TYPES)} joints can be used")
            for mimic in element.findall("mimic"):
                leader = mimic.get("joint", "")
                if leader not in joints:
                    faults.append(
                        f"{what} mimics {leader!r}, which is not a joint; {suggestion(leader, sorted(joints))}"
                    )
    leaders = {e.get("name", ""): m.get("joint", "") for e in elements if (m := e.find("mimic")) is not None}
    circles = [name for name in leaders if _follows_itself(name, leaders)]
    if circles:
        faults.append(f"joints {', '.join(circles)} mimic each other in a circle: one of them has to lead")
    return faults


def _number_faults(element: ET.Element) -> Iterator[str]:
    for inner in element.iter():
        for attributes, count in ((_THREE, 3), (_ONE, 1)):
            for key in attributes.get(inner.tag, ()):
                text = inner.get(key)
                if text is not None and not _is_numbers(text, count):
                    place = key if inner.tag == "origin" else f"{inner.tag} {key}"
                    owed = "three numbers" if count == 3 else "a number"
                    yield f"gives its {place} as {text!r}: that should be {owed}"


def _is_numbers(text: str, count: int) -> bool:
    try:
        numbers = [float(number) for number in text.split()]
    except ValueError:
        return False
    return len(numbers) == count and all(map(math.isfinite, numbers))


def _twice(names: Iterable[str]) -> list[str]:
    return [name for name, count in Counter(names).items() if count > 1]


def _reached(root: str, joints: list[ET.Element]) -> set[str]:
    below: dict[str, list[str]] = {}
    for joint in joints:
        below.setdefault(parent_of(joint), []).append(child_of(joint))
    found, waiting = {root}, [root]
    while waiting:
        new = [child for child in below.get(waiting.pop(), ()) if child not in found]
        found.update(new)
        waiting += new
    return found


def _follows_itself(joint: str, leaders: dict[str, str]) -> bool:
    leader, seen = leaders.get(joint), {joint}
    while leader is not None and leader not in seen:
        seen.add(leader)
        leader = leaders.get(leader)
    return leader == joint
