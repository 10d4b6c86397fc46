"""Robots from parts: one URDF, and beside it everything that a program must know about the robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bestman_bt.configuration import (
    ConfigurationError,
    Document,
    Problem,
    check,
    find_data,
    override,
    read_document,
)
from bestman_bt.registry import suggestion
from bestman_bt.robot_model.calibration_overlay import with_calibration
from bestman_bt.robot_model.describe import describe
from bestman_bt.robot_model.hardware_config import with_hardware
from bestman_bt.robot_model.joint_limits import write_limits
from bestman_bt.robot_model.load_limits import load_problems
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.mounting import mount_place, mount_problems
from bestman_bt.robot_model.part_config import JointedPart
from bestman_bt.robot_model.placed_part import PlacedPart, read_part
from bestman_bt.robot_model.robot_config import RobotConfig
from bestman_bt.robot_model.urdf_elements import fixed_joint


def load_robot_model(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> RobotModel:
    """Compose the robot that a YAML of parts describes.

    A bare name means a shipped robot. ``overrides``: dotted keys → values, for example
    ``{"parts.mast.set.dimensions.mass": "2 kg"}``. Raises ConfigurationError with file, line and field.
    """
    path = find_data("robot", name_or_path)
    settings = dict(overrides or {})
    document = read_document(path)
    if "calibration" in settings:
        document = override(document, RobotConfig, {"calibration": settings.pop("calibration")}, prefix="robot.")
        document = with_calibration(document, Path())
    else:
        document = with_calibration(document, path.parent)
    document = override(document, RobotConfig, settings, prefix="robot.")
    return compose_robot(path.stem, document)


def compose_robot(name: str, document: Document) -> RobotModel:
    """Compose a robot from the document of a ``RobotConfig``; raises ConfigurationError."""
    config = check(document, RobotConfig)
    placed = _place_parts(config, document)
    urdf = ET.Element("robot", name=name)
    for part in placed.values():
        urdf.extend(part.elements)
        place = mount_place(config.parts[part.name], part, placed)
        if place is not None:
            link, xyz, rpy = place
            urdf.append(fixed_joint(f"{part.name}_mount_joint", link, part.root, xyz, rpy))
        write_limits(part)
    links = {link.get("name", "") for link in urdf.findall("link")}
    base_frame = config.base_frame or next(iter(placed.values())).root
    if base_frame not in links:
        message = f"no link {base_frame!r}; {suggestion(base_frame, list(links))}"
        raise ConfigurationError([document.problem(("base_frame",), message)])
    postures = _postures(config, document, placed)
    ignored = _declared_pairs(config, document, placed, links)
    ET.indent(urdf)
    model = describe(name, urdf, base_frame, placed, postures, ignored)
    problems = load_problems(model, placed, document)
    if problems:
        raise ConfigurationError(problems)
    return with_hardware(model, config, document)


def _place_parts(config: RobotConfig, document: Document) -> dict[str, PlacedPart]:
    problems: list[Problem] = []
    placed: dict[str, PlacedPart] = {}
    taken: set[str] = set()
    unread = False  # a part that could not be read takes its frames away: no word on later mounts
    for part_name, mounted in config.parts.items():
        changes = document.below("parts", part_name, "set") if mounted.set else Document({})
        asked_by = document.problem(("parts", part_name, "part"), "")
        try:
            part: PlacedPart | None = read_part(part_name, mounted.part, changes, asked_by, taken)
        except ConfigurationError as error:
            part = None
            faults = error.problems
        if not unread:
            problems += mount_problems(document, part_name, mounted, part, placed)
        if part is None:
            problems += faults
            unread = True
            continue
        placed[part_name] = part
        taken |= {element.get("name", "") for element in part.elements}
    if not config.parts:
        problems.append(document.problem(("parts",), "a robot needs at least one part"))
    if problems:
        raise ConfigurationError(problems)
    return placed


def _postures(config: RobotConfig, document: Document, placed: Mapping[str, PlacedPart]) -> dict[str, dict[str, float]]:
    problems: list[Problem] = []
    postures: dict[str, dict[str, float]] = {}
    for posture, of_parts in config.postures.items():
        postures[posture] = {}
        for part_name, positions in of_parts.items():
            field = ("postures", posture, part_name)
            part = placed.get(part_name)
            joints: tuple[str, ...] = getattr(part.config, "joints", ()) if part is not None else ()
            if part is None:
                message = f"unknown part; {suggestion(part_name, list(placed))}"
                problems.append(document.problem(field, message))
            elif len(positions) != len(joints):
                message = f"should have {len(joints)} positions, one per joint, got {len(positions)}"
                problems.append(document.problem(field, message))
            else:
                postures[posture] |= dict(zip(joints, positions, strict=True))
                problems += _limit_problems(document, field, part.config, positions)
    if problems:
        raise ConfigurationError(problems)
    for part in placed.values():
        if isinstance(part.config, JointedPart):
            for state, positions in part.config.states.items():
                for joint, position in zip(part.config.joints, positions, strict=True):
                    postures.setdefault(state, {}).setdefault(joint, position)
    return postures


def _limit_problems(
    document: Document, field: tuple[str, str, str], config: Any, positions: tuple[float, ...]
) -> list[Problem]:
    if not isinstance(config, JointedPart):
        return []
    rows = zip(config.joints, positions, config.limits.lower, config.limits.upper, strict=True)
    return [
        document.problem((*field, index), f"{joint} should be within [{lower:g}, {upper:g}], got {position:g}")
        for index, (joint, position, lower, upper) in enumerate(rows)
        if not lower <= position <= upper
    ]


def _declared_pairs(
    config: RobotConfig, document: Document, placed: Mapping[str, PlacedPart], links: set[str]
) -> list[tuple[str, str]]:
    problems: list[Problem] = []
    pairs = [pair for part in placed.values() for pair in part.config.may_touch]
    for index, names in enumerate(config.never_touch):
        groups: list[list[str]] = []
        for name in names:
            if name in placed:
                groups.append(placed[name].links)
            elif name in links:
                groups.append([name])
            else:
                message = f"no part or link {name!r}; {suggestion(name, [*placed, *links])}"
                problems.append(document.problem(("never_touch", index), message))
        if len(groups) == 2:
            pairs += [(a, b) for a in groups[0] for b in groups[1]]
    if problems:
        raise ConfigurationError(problems)
    return pairs
