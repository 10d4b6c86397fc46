"""A part of a robot after reading and generating: its elements and description, with names unique in the robot."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration.checked import check, is_whole, salvage
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem, UnreadError
from bestman_bt.messages import Box
from bestman_bt.registry import PARTS, UnknownNameError, suggestion
from bestman_bt.robot_model.finger_linkage import MimicJoint, opening_table
from bestman_bt.robot_model.footprint import origin_pose, outline
from bestman_bt.robot_model.generators import GENERATORS
from bestman_bt.robot_model.part_config import (
    ArmPart,
    BasePart,
    GripperPart,
    JointedPart,
    JointGroupPart,
    LeggedBasePart,
)
from bestman_bt.robot_model.part_fields import ContactConfig, PadConfig, PartConfig
from bestman_bt.robot_model.urdf_elements import (
    TINY_INERTIA,
    child_of,
    fixed_joint,
    link,
    move_origin,
    numbers,
    origin,
    shape,
    tiny_inertial,
)
from bestman_bt.robot_model.urdf_source import Subtree, UrdfError, locate_urdf, read_subtree

DENSITY = 1000.0
"""kg/m³, of the convex hull of a link of unknown mass: a typical value of castings with motors."""

_ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def complete_inertial(link: ET.Element, mass: float | None = None) -> None:
    """Give a link positive mass and inertia.

    ``mass``: kilograms, replaces the source's. Values of the source are kept, and impossible moments are corrected.
    Without values, the link counts as its homogeneous convex hull, of ``DENSITY`` if its mass is unknown; a link
    without a collision shape is a frame and gets a tiny mass.
    """
    inertial = link.find("inertial")
    known = _mass(inertial)
    if inertial is not None and known is not None and mass is None and _make_possible(inertial):
        return
    if inertial is not None:
        link.remove(inertial)
    corners = _corners(link)
    if len(corners) < 4:
        link.append(tiny_inertial() if mass is None and known is None else _point(mass or known or 0.0))
        return
    volume, centre, unit = _hull_properties(corners.tobytes())
    weight = mass or known or DENSITY * volume
    link.append(_inertial(weight, unit * (weight / volume), centre))


def add_rotor_inertia(link: ET.Element, inertia: float) -> None:
    """Add the inertia of a geared drive's rotor about its joint, kg m²: inertia × reduction²."""
    element = link.find("inertial/inertia")
    if element is not None:
        for key in ("ixx", "iyy", "izz"):
            element.set(key, f"{float(element.get(key, '0')) + inertia:.9g}")


def _mass(inertial: ET.Element | None) -> float | None:
    element = None if inertial is None else inertial.find("mass")
    value = 0.0 if element is None else float(element.get("value", "0"))
    return value if value > 0.0 else None


def _make_possible(inertial: ET.Element) -> bool:
    """Return whether the principal moments are positive; the smallest is raised to what the sum of two owes the third.

    Simulators take moments that violate this as zero, and the link then spins freely about that axis.
    """
    element = inertial.find("inertia")
    if element is None:
        return False
    ixx, ixy, ixz, iyy, iyz, izz = (float(element.get(key, "0")) for key in _ENTRIES)
    moments, axes = np.linalg.eigh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if moments[0] <= 0.0:
        return False
    owed = 1.001 * (moments[2] - moments[1])
    if moments[0] < owed:
        _write_inertia(element, axes @ np.diag([owed, moments[1], moments[2]]) @ axes.T)
    return True


def _corners(link: ET.Element) -> NDArray[np.float64]:
    clouds = [np.zeros((0, 3))]
    clouds.extend(
        origin_pose(collision).apply(outline(collision.find("geometry"))) for collision in link.findall("collision")
    )
    return np.concatenate(clouds)


@lru_cache(maxsize=256)
def _hull_properties(corners: bytes) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return volume, centre (3,) and inertia (3, 3) at unit density of the hull of points."""
    from trimesh.convex import convex_hull

    hull = convex_hull(np.frombuffer(corners).reshape(-1, 3))
    return float(hull.volume), np.array(hull.center_mass), np.array(hull.moment_inertia)


def _inertial(mass: float, inertia: NDArray[np.float64], centre: NDArray[np.float64]) -> ET.Element:
    element = ET.Element("inertial")
    element.append(origin(centre.tolist()))
    ET.SubElement(element, "mass", value=f"{mass:.9g}")
    _write_inertia(ET.SubElement(element, "inertia"), inertia)
    return element


def _write_inertia(element: ET.Element, inertia: NDArray[np.float64]) -> None:
    element.attrib.update({name: numbers([inertia[place]]) for name, place in _ENTRIES.items()})


def _point(mass: float) -> ET.Element:
    moment = max(TINY_INERTIA, mass * 1e-4)  # a ball of 16 mm: something without a shape is small
    return _inertial(mass, np.diag([moment] * 3), np.zeros(3))


WIDTH_TOLERANCE = 1e-3
FOOTPRINT = "base_footprint"
"""The link on the floor below the trunk of a legged base."""
_NAME_FIELDS = (
    "root",
    "tip",
    "top",
    "tool",
    "frame",
    "wheel_joints",
    "steering_joints",
    "caster_links",
    "joints",
    "finger_links",
    "feet",
    "cup",
    "may_touch",
)


@dataclass(frozen=True)
class PlacedPart:
    """``elements``: links and joints; ``root``: the link that is mounted; ``config``: names as in the robot.

    ``mimics``: joints that a mechanism couples to others. ``opening``: of a hand with fingers on a linkage, pairs
    (joint position, width).
    """

    name: str
    config: PartConfig
    elements: list[ET.Element]
    root: str
    mimics: tuple[MimicJoint, ...] = ()
    opening: tuple[tuple[float, float], ...] = ()

    @property
    def links(self) -> list[str]:
        """Return the names of the part's links."""
        return [element.get("name", "") for element in self.elements if element.tag == "link"]

    def mass_of(self, links: Iterable[str]) -> float:
        """Return the mass of some of its links, kg."""
        wanted = set(links)
        masses = (e.find("inertial/mass") for e in self.elements if e.tag == "link" and e.get("name", "") in wanted)
        return sum(float(mass.get("value", "0")) for mass in masses if mass is not None)


def read_part(
    name: str, description: str, changes: Document, asked_by: Problem, taken: set[str], faults: list[Problem]
) -> PlacedPart:
    """Read the part called ``name``.

    ``description``: name or path of its YAML, overridden by ``changes``. ``taken``: link and joint names of other
    parts: if one of this part's is among them, all of this part's get the prefix ``<name>_``. Faults are added to
    ``faults`` if the part can be read in spite of them. Raises ConfigurationError otherwise.
    """
    path = find_data("part", description, asked_by)
    document = _with_name(read_document(path, faults), name).merged(changes)
    kind = document.data.get("kind")
    try:
        part_type: type[PartConfig] = PARTS.resolve(str(kind or ""))
    except UnknownNameError as error:
        raise ConfigurationError([document.problem(("kind",), str(error) if kind else "is missing")]) from error
    config, problems = salvage(document, part_type)
    faults += problems
    if not is_whole(config):
        raise UnreadError(description)
    subtree = _elements(name, config, document, path.parent)
    elements, root, mimics = subtree.elements, subtree.root, subtree.mimics
    if isinstance(config, LeggedBasePart):
        below = (0.0, 0.0, config.stand_height)
        elements = [link(FOOTPRINT), fixed_joint(f"{FOOTPRINT}_joint", FOOTPRINT, root, below), *elements]
        root = FOOTPRINT
    if isinstance(config, BasePart):
        move_origin(elements, root, (config.turning_centre, 0.0, 0.0))
    elements += _added_frames(config)
    names = {element.get("name", "") for element in elements}
    _check_names(config, document, names)
    for element in elements:
        if element.tag == "link":
            _dress(element, config)
    _add_rotors(config, elements, mimics)
    if names & taken:
        renamed = {old: f"{name}_{old}" for old in names}
        _rename(elements, renamed)
        config = _renamed_config(config, renamed)
        root = renamed[root]
        mimics = tuple(
            dataclasses.replace(mimic, joint=renamed[mimic.joint], leader=renamed.get(mimic.leader, mimic.leader))
            for mimic in mimics
        )
    opening = _opening(config, document, elements, mimics)
    return PlacedPart(name, config, elements, root, mimics, opening)


def links_of_invalid_part(name: str, description: str, changes: Document, taken: set[str]) -> list[str] | None:
    """Return the link names of a part that ``read_part`` refuses, or None if they cannot be read.

    ``taken``: as for ``read_part``.
    """
    try:
        path = find_data("part", description)
        document = _with_name(read_document(path, []), name).merged(changes)
        part_type: type[PartConfig] = PARTS.resolve(str(document.data.get("kind") or ""))
        config, _ = salvage(document, part_type)
        elements = [*_elements(name, config, document, path.parent).elements, *_added_frames(config)]
    except (ConfigurationError, UnknownNameError):
        return None
    links = [FOOTPRINT] if isinstance(config, LeggedBasePart) else []
    links += [element.get("name", "") for element in elements if element.tag == "link"]
    return links if taken.isdisjoint(links) else [f"{name}_{link}" for link in links]


def _opening(
    config: PartConfig, document: Document, elements: list[ET.Element], mimics: tuple[MimicJoint, ...]
) -> tuple[tuple[float, float], ...]:
    if not isinstance(config, GripperPart) or (config.open_at is None and config.closed_at is None):
        return ()
    if config.open_at is None or config.closed_at is None or config.open_at == config.closed_at:
        message = "fingers on a linkage need both 'open_at' and 'closed_at', and they should differ"
        raise ConfigurationError([document.problem(("open_at",), message)])
    travel = (config.open_at, config.closed_at)
    table = opening_table(elements, config.joints, mimics, config.finger_links, config.tool, travel, config.min_width)
    widths = np.array([width for _, width in table])
    if not np.all(np.diff(widths) < 0.0):
        message = f"between {travel[0]:g} and {travel[1]:g} the fingers do not close all the way along y of the tool"
        raise ConfigurationError([document.problem(("closed_at",), message)])
    if abs(widths[0] - config.max_width) > WIDTH_TOLERANCE:
        message = f"at open_at the fingers are {1e3 * widths[0]:.1f} mm apart by the URDF, not {config.max_width:g} m"
        raise ConfigurationError([document.problem(("max_width",), message)])
    return table


def _add_rotors(config: PartConfig, elements: list[ET.Element], mimics: tuple[MimicJoint, ...]) -> None:
    if not isinstance(config, GripperPart | BasePart | JointGroupPart | LeggedBasePart) or config.rotor_inertia == 0.0:
        return
    joints = config.wheel_joints if isinstance(config, BasePart) else config.joints
    turned = {*joints, *(mimic.joint for mimic in mimics)}
    ends = {child_of(element) for element in elements if element.get("name", "") in turned}
    for element in elements:
        if element.tag == "link" and element.get("name", "") in ends:
            add_rotor_inertia(element, config.rotor_inertia)


def _added_frames(config: PartConfig) -> list[ET.Element]:
    added = []
    for name, frame in config.frames.items():
        added += [link(name), fixed_joint(f"{name}_joint", frame.link, name, frame.xyz, frame.rpy)]
    return added


def _with_name(document: Document, name: str) -> Document:
    """Replace ``<part>`` in a description by the part's name in its robot."""

    def fill(value: Any) -> Any:
        if isinstance(value, str):
            return value.replace("<part>", name)
        if isinstance(value, list):
            return [fill(item) for item in value]
        if isinstance(value, dict):
            return {fill(key): fill(item) for key, item in value.items()}
        return value

    return Document(fill(document.data), document.origins)


def _elements(name: str, config: PartConfig, document: Document, folder: Path) -> Subtree:
    if (config.urdf is None) == (config.generated is None):
        raise ConfigurationError([document.problem((), "one of 'urdf' and 'generated' should be given")])
    if config.urdf is not None:
        try:
            return read_subtree(
                locate_urdf(config.urdf, folder), config.root, config.cut, [folder / name for name in config.packages]
            )
        except UrdfError as error:
            raise ConfigurationError(document.problem(("urdf",), fault) for fault in error.faults) from error
    generated = config.generated or ""
    if generated not in GENERATORS:
        message = f"unknown generator {generated!r}; {suggestion(generated, list(GENERATORS))}"
        raise ConfigurationError([document.problem(("generated",), message)])
    dimensions_type, generate = GENERATORS[generated]
    inside = document.below("dimensions") if "dimensions" in document.data else Document({}, {(): document.origin(())})
    try:
        dimensions: Any = check(inside, dimensions_type)
    except ConfigurationError as error:
        raise ConfigurationError(
            dataclasses.replace(p, field=f"dimensions.{p.field}" if p.field else "dimensions") for p in error.problems
        ) from error
    try:
        generated_part = generate(name, dimensions)
    except UrdfError as error:
        raise ConfigurationError(document.problem(("dimensions",), fault) for fault in error.faults) from error
    if isinstance(generated_part, Subtree):
        return generated_part
    return Subtree(generated_part, generated_part[0].get("name", ""))


def _check_names(config: PartConfig, document: Document, names: set[str]) -> None:
    problems = [*_unknown_names(config, document, names), *_wrong_counts(config, document)]
    if problems:
        raise ConfigurationError(problems)


def _unknown_names(config: PartConfig, document: Document, names: set[str]) -> Iterator[Problem]:
    for field in (*_NAME_FIELDS, "collision", "contact", "mass"):
        for named in _flat(getattr(config, field, None)):
            if named not in names:
                message = f"the part has no link or joint {named!r}; {suggestion(named, list(names))}"
                yield document.problem((field,), message)


def _wrong_counts(config: PartConfig, document: Document) -> Iterator[Problem]:
    limits = getattr(config, "limits", None)
    if limits is not None:
        for each in dataclasses.fields(limits):
            field = ("limits", each.name)
            count, expected = document.count(field), len(getattr(config, "joints", ()))
            if count not in (None, expected):
                yield document.problem(field, f"should have {expected} entries, one per joint, got {count}")
    if isinstance(config, ArmPart | JointGroupPart):
        for joint in config.constraints.joints:
            if joint not in config.joints:
                message = f"the part has no joint {joint!r}; {suggestion(joint, list(config.joints))}"
                yield document.problem(("constraints", "joints", joint), message)
    if isinstance(config, JointedPart):
        for state in config.states:
            count = document.count(("states", state))
            if count not in (None, len(config.joints)):
                message = f"should have {len(config.joints)} positions, one per joint, got {count}"
                yield document.problem(("states", state), message)


def _flat(value: Any) -> list[str]:
    if value is None:
        return []
    if isinstance(value, str):
        return [value]
    return [text for item in value for text in _flat(item)]


def _dress(dressed: ET.Element, config: PartConfig) -> None:
    """Give a link the collision shape, contact parameters and mass of its part's description."""
    name = dressed.get("name", "")
    pads: tuple[PadConfig, ...] | None = config.collision.get(name)
    if pads is not None:
        for collision in dressed.findall("collision"):
            dressed.remove(collision)
        dressed.extend(shape("collision", Box(pad.size), pad.xyz) for pad in pads)
    contact: ContactConfig | None = config.contact.get(name)
    if contact is not None:
        element = ET.SubElement(dressed, "contact")
        for field in dataclasses.fields(contact):
            value = getattr(contact, field.name)
            if value is not None:
                ET.SubElement(element, field.name, value=f"{value:.9g}")
    complete_inertial(dressed, config.mass.get(name))


def _rename(elements: list[ET.Element], renamed: dict[str, str]) -> None:
    for element in elements:
        element.set("name", renamed[element.get("name", "")])
        for end in (*element.findall("parent"), *element.findall("child")):
            end.set("link", renamed[end.get("link", "")])


def _renamed_config(config: PartConfig, renamed: dict[str, str]) -> PartConfig:
    def rename(value: Any) -> Any:
        if isinstance(value, str):
            return renamed[value]
        if isinstance(value, tuple):
            return tuple(rename(item) for item in value)
        return value

    fields = {field.name for field in dataclasses.fields(config)}
    changed = {field: rename(getattr(config, field)) for field in _NAME_FIELDS if field in fields}
    if isinstance(config, ArmPart | JointGroupPart):
        constraints = config.constraints
        joints = {renamed[joint]: each for joint, each in constraints.joints.items()}
        changed["constraints"] = dataclasses.replace(constraints, joints=joints)
    return dataclasses.replace(config, **changed)
