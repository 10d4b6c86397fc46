"""One part of a robot, read and generated: its elements, its description, all names unique in the robot."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bestman_bt.configuration import ConfigurationError, Document, Problem, check, find_data, read_document
from bestman_bt.messages import Box
from bestman_bt.registry import suggestion
from bestman_bt.robot_model.generators import GENERATORS
from bestman_bt.robot_model.part_config import PART_KINDS, AnyPart, ContactConfig, PadConfig
from bestman_bt.robot_model.urdf_elements import shape
from bestman_bt.robot_model.urdf_source import UrdfError, locate_urdf, read_subtree

_NAME_FIELDS = ("root", "tip", "tool", "frame", "wheel_joints", "caster_links", "joints", "finger_links", "may_touch")


@dataclass(frozen=True)
class PlacedPart:
    """``elements``: links and joints; ``root``: the link that is mounted; ``config``: names as in the robot."""

    name: str
    config: AnyPart
    elements: list[ET.Element]
    root: str

    @property
    def links(self) -> list[str]:
        """Names of the part's links."""
        return [element.get("name", "") for element in self.elements if element.tag == "link"]


def read_part(name: str, description: str, changes: Document, asked_by: Problem, taken: set[str]) -> PlacedPart:
    """Read the part called ``name`` in its robot.

    ``description``: name or path of its YAML, ``changes`` is laid over it. ``taken``: link and joint names that
    other parts have: if one of this part's is among them, all of this part's get the prefix ``<name>_``.
    """
    path = find_data("part", description, asked_by)
    document = _with_name(read_document(path), name).merged(changes)
    kind = document.data.get("kind")
    if not isinstance(kind, str) or kind not in PART_KINDS:
        message = f"unknown kind {kind!r}; {suggestion(str(kind), list(PART_KINDS))}" if kind else "is missing"
        raise ConfigurationError([document.problem(("kind",), message)])
    config: AnyPart = check(document, PART_KINDS[kind])
    elements, root = _elements(name, config, document, path.parent)
    names = {element.get("name", "") for element in elements}
    _check_names(config, document, names)
    for element in elements:
        if element.tag == "link":
            _dress(element, config)
    if names & taken:
        renamed = {old: f"{name}_{old}" for old in names}
        _rename(elements, renamed)
        config = _renamed_config(config, renamed)
        root = renamed[root]
    return PlacedPart(name, config, elements, root)


def _with_name(document: Document, name: str) -> Document:
    """``<part>`` in a description stands for the part's name in its robot."""

    def fill(value: Any) -> Any:
        if isinstance(value, str):
            return value.replace("<part>", name)
        if isinstance(value, list):
            return [fill(item) for item in value]
        if isinstance(value, dict):
            return {fill(key): fill(item) for key, item in value.items()}
        return value

    return Document(fill(document.data), document.origins)


def _elements(name: str, config: AnyPart, document: Document, folder: Path) -> tuple[list[ET.Element], str]:
    if (config.urdf is None) == (config.generated is None):
        raise ConfigurationError([document.problem((), "one of 'urdf' and 'generated' should be given")])
    if config.urdf is not None:
        try:
            return read_subtree(locate_urdf(config.urdf, folder), config.root, config.cut)
        except UrdfError as error:
            raise ConfigurationError([document.problem(("urdf",), str(error))]) from error
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
    elements = generate(name, dimensions)
    return elements, elements[0].get("name", "")


def _check_names(config: AnyPart, document: Document, names: set[str]) -> None:
    problems = []
    for field in (*_NAME_FIELDS, "collision", "contact"):
        for named in _flat(getattr(config, field, None)):
            if named not in names:
                message = f"the part has no link or joint {named!r}; {suggestion(named, list(names))}"
                problems.append(document.problem((field,), message))
    limits = getattr(config, "limits", None)
    if limits is not None:
        for each in dataclasses.fields(limits):
            count, expected = len(getattr(limits, each.name)), len(getattr(config, "joints", ()))
            if count != expected:
                message = f"should have {expected} entries, one per joint, got {count}"
                problems.append(document.problem(("limits", each.name), message))
    if problems:
        raise ConfigurationError(problems)


def _flat(value: Any) -> list[str]:
    if value is None:
        return []
    if isinstance(value, str):
        return [value]
    return [text for item in value for text in _flat(item)]


def _dress(link: ET.Element, config: AnyPart) -> None:
    pads: tuple[PadConfig, ...] | None = config.collision.get(link.get("name", ""))
    if pads is not None:
        for collision in link.findall("collision"):
            link.remove(collision)
        link.extend(shape("collision", Box(pad.size), pad.xyz) for pad in pads)
    contact: ContactConfig | None = config.contact.get(link.get("name", ""))
    if contact is not None:
        element = ET.SubElement(link, "contact")
        for field in dataclasses.fields(contact):
            value = getattr(contact, field.name)
            if value is not None:
                ET.SubElement(element, field.name, value=f"{value:.9g}")


def _rename(elements: list[ET.Element], renamed: dict[str, str]) -> None:
    for element in elements:
        element.set("name", renamed[element.get("name", "")])
        for end in (*element.findall("parent"), *element.findall("child")):
            end.set("link", renamed[end.get("link", "")])


def _renamed_config(config: AnyPart, renamed: dict[str, str]) -> AnyPart:
    def rename(value: Any) -> Any:
        if isinstance(value, str):
            return renamed[value]
        if isinstance(value, tuple):
            return tuple(rename(item) for item in value)
        return value

    fields = {field.name for field in dataclasses.fields(config)}
    changed = {field: rename(getattr(config, field)) for field in _NAME_FIELDS if field in fields}
    return dataclasses.replace(config, **changed)
