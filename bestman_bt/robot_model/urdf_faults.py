"""Faults of the links and joints of a URDF, all at once, in words."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Iterator

from bestman_bt.registry import suggestion
from bestman_bt.robot_model.urdf_elements import child_of, parent_of

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
                faults.append(f"the {what} of joint {joint.get('name')!r} is {link!r}, which is no link; {hint}")
    held_twice = _twice(child_of(joint) for joint in joints)
    if held_twice:
        faults.append(f"is no tree: {', '.join(held_twice)} hangs on two joints")
    carried = {child_of(joint) for joint in joints}
    roots = [name for name in dict.fromkeys(links) if name not in carried]
    if not roots:
        faults.append("has no root link: its joints go round in a circle" if links else "has no links")
    elif len(roots) > 1:
        faults.append(f"should have one root link, it has {', '.join(roots)}")
    elif not faults:
        reached = _reached(roots[0], joints)
        lost = [name for name in links if name not in reached]
        if lost:
            faults.append(f"does not hang together: {', '.join(lost)} go round in a circle")
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
                    faults.append(f"{what} mimics {leader!r}, which is no joint; {suggestion(leader, sorted(joints))}")
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
