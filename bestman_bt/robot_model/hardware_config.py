"""Connections and safety limits of a robot's YAML, checked and added to its model."""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from bestman_bt.configuration.checked import numbered, salvage
from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import (
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    up_to_unread_field,
)
from bestman_bt.registry import CONNECTIONS, UnknownNameError, suggestion
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig, host_and_port
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, Part, RobotModel
from bestman_bt.robot_model.part_config import ArmPart
from bestman_bt.robot_model.part_fields import PartConfig
from bestman_bt.robot_model.robot_config import RobotConfig

_VARIABLE = re.compile(r"\$\{(\w+)\}")
ROUNDING = 1e-6


def with_hardware(model: RobotModel, connections: Mapping[str, ConnectionConfig], safety: SafetyConfig) -> RobotModel:
    """Return ``model`` with its connections, limited by ``safety``."""
    return dataclasses.replace(
        model,
        parts={name: _within(safety, part) for name, part in model.parts.items()},
        connections=dict(connections),
        safety=safety,
    )


FIRST_JOINT_SPEED, FIRST_TOOL_SPEED = 0.1, 0.25
"""Largest speeds of real arms without a signed bring-up: fraction of the joints' limits, and m/s."""


def with_first_limits(model: RobotModel) -> RobotModel:
    """Return ``model`` with arms limited to the speed of a real robot's first motions."""
    if not model.of(ArmModel):
        return model
    safety = model.safety
    allowed = 1.0 if safety.joint_speed is None else safety.joint_speed
    share = min(allowed, FIRST_JOINT_SPEED)
    tool_speed = FIRST_TOOL_SPEED if safety.tool_speed is None else min(safety.tool_speed, FIRST_TOOL_SPEED)
    slower = with_hardware(model, model.connections, dataclasses.replace(safety, joint_speed=share / allowed))
    return dataclasses.replace(slower, safety=dataclasses.replace(safety, joint_speed=share, tool_speed=tool_speed))


def read_connections(
    config: RobotConfig, document: Document, parts: Mapping[str, PartConfig | None]
) -> tuple[dict[str, ConnectionConfig], list[Problem]]:
    """Return the connections with their options as the driver's own dataclass, and all faults of these and of
    ``safety``.

    ``parts``: those of the robot, or None if one could not be read.
    """
    faults = ProblemCollector(
        [*_part_problems(config, document, list(parts)), *_safety_problems(config.safety, document)]
    )
    connections: dict[str, ConnectionConfig] = {}
    for name, connection in config.connections.items():
        with faults.step():
            connections[name] = _read_connection(name, connection, document, parts)
    return connections, faults.problems


def _read_connection(
    name: str, connection: ConnectionConfig, document: Document, parts: Mapping[str, PartConfig | None]
) -> ConnectionConfig:
    try:
        driver: Any = CONNECTIONS.resolve(connection.driver)
    except UnknownNameError as error:
        raise ConfigurationError([document.problem(("connections", name, "driver"), str(error))]) from error
    given = document.below("connections", name, "options") if connection.options else Document({})
    options, problems = salvage(given, driver.options_type)
    faults = ProblemCollector([*_kind_problems(name, connection, driver.serves, document, parts)])
    faults.problems += ConfigurationError(problems).within("connections", name, "options").problems
    faults.problems += _payload_problems(name, connection, options, document, parts)
    faults.raise_if_any()
    return dataclasses.replace(
        connection,
        options=options,
        address=_from_environment(connection.address),
        token=_from_environment(connection.token),
    )


def _from_environment(text: str) -> str:
    """Replace ``${NAME}`` by the environment variable, or by an empty text if it is not set."""
    variable = _VARIABLE.fullmatch(text)
    return text if variable is None else os.environ.get(variable[1], "")


def _part_problems(config: RobotConfig, document: Document, known: list[str]) -> Iterator[Problem]:
    spoken_for: dict[str, str] = {}
    for name, connection in config.connections.items():
        field = ("connections", name, "parts")
        with suppress(UnreadError):
            if not connection.parts and not document.data["connections"][name]["parts"]:
                yield document.problem(field, "should name at least one part")
            for index, part in numbered(connection.parts):
                if part not in known:
                    yield document.problem((*field, index), f"unknown part {part!r}; {suggestion(part, known)}")
                elif part in spoken_for:
                    yield document.problem(
                        (*field, index), f"{part!r} is behind connection {spoken_for[part]!r} already"
                    )
                spoken_for[part] = name


@up_to_unread_field
def _kind_problems(
    name: str,
    connection: ConnectionConfig,
    serves: Mapping[str, tuple[int, int]],
    document: Document,
    parts: Mapping[str, PartConfig | None],
) -> Iterator[Problem]:
    """Yield problems if the driver cannot serve the parts of its controller."""
    kinds = [control_kind(part.kind) for name in connection.parts if (part := parts.get(name)) is not None]
    if not serves or not kinds or len(kinds) < len(connection.parts):
        return
    field = ("connections", name, "parts")
    owed = f"behind a connection of the driver {connection.driver!r} can be: {', '.join(serves)}"
    strange = [index for index, kind in enumerate(kinds) if kind not in serves]
    for index in strange:
        yield document.problem((*field, index), f"{connection.parts[index]!r} is of the kind {kinds[index]}; {owed}")
    if strange:
        return
    for kind, (least, most) in serves.items():
        count = kinds.count(kind)
        if not least <= count <= most:
            number = f"{least}" if least == most else f"at most {most}"
            yield document.problem(field, f"should name {number} of the kind {kind}, names {count}; {owed}")


def control_kind(kind: str) -> str:
    """Return the kind of part that a controller uses for ``kind``: a suction cup is controlled as a gripper."""
    return "gripper" if kind == "suction" else kind


@up_to_unread_field
def _payload_problems(
    name: str, connection: ConnectionConfig, options: Any, document: Document, parts: Mapping[str, PartConfig | None]
) -> Iterator[Problem]:
    load = getattr(options, "payload", None)
    for part in connection.parts:
        arm = parts.get(part)
        if load is not None and isinstance(arm, ArmPart) and arm.payload is not None and load > arm.payload:
            message = f"{load:g} kg is more than {part!r} may carry: {arm.payload:g} kg"
            yield document.problem(("connections", name, "options", "payload"), message)


def wider_limits(name: str, part: ArmPart, described: ArmPart, document: Document) -> Iterator[Problem]:
    """Yield problems where the robot's file exceeds the vendor's limits of the ``described`` arm."""
    for field in ("lower", "upper", "velocity", "acceleration", "effort"):
        of_file, of_part = getattr(part.limits, field), getattr(described.limits, field)
        for joint, asked, most in zip(part.joints, of_file, of_part, strict=False):
            if asked < most - ROUNDING if field == "lower" else asked > most + ROUNDING:
                message = f"{joint} = {asked:.4g} is beyond the limit of the part {name!r}, {most:.4g} (SI units)"
                yield document.problem(("parts", name, "set", "limits", field), message)


@up_to_unread_field
def _safety_problems(safety: SafetyConfig, document: Document) -> Iterator[Problem]:
    if safety.stop_input is not None:
        try:
            host_and_port(safety.stop_input.address)
        except ValueError as error:
            yield document.problem(("safety", "stop_input", "address"), str(error))
    box = safety.workspace
    if box is not None:
        for axis, lower, upper in zip("xyz", box.lower, box.upper, strict=True):
            if lower >= upper:
                message = f"lower {axis} = {lower:g} m should be below upper {axis} = {upper:g} m"
                yield document.problem(("safety", "workspace"), message)


def _within(safety: SafetyConfig, part: Part) -> Part:
    """Return the part, no faster or stronger than ``safety`` allows."""
    config: Any = getattr(part, "part", None)
    match part:
        case ArmModel():
            share = 1.0 if safety.joint_speed is None else safety.joint_speed
            speeds = tuple(speed * share for speed in config.limits.velocity)
            slower = dataclasses.replace(config, limits=dataclasses.replace(config.limits, velocity=speeds))
        case BaseModel():
            speed = math.inf if safety.base_speed is None else safety.base_speed
            turn = math.inf if safety.base_turn is None else safety.base_turn
            slower = config.slowed(speed, turn)
        case GripperModel():
            force = math.inf if safety.gripper_force is None else safety.gripper_force
            slower = dataclasses.replace(config, max_force=min(config.max_force, force))
        case _:
            return part
    return dataclasses.replace(part, part=slower)
