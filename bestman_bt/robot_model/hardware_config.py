"""Connections and safety limits of a robot's YAML, checked and brought into its model."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration import ConfigurationError, Document, Problem, check
from bestman_bt.registry import CONNECTIONS, UnknownNameError, suggestion
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, RobotModel
from bestman_bt.robot_model.robot_config import RobotConfig


def with_hardware(model: RobotModel, config: RobotConfig, document: Document) -> RobotModel:
    """``model`` with its connections, and no faster or stronger than ``safety`` allows; raises ConfigurationError."""
    connections, problems = _connections(config, document)
    problems += _part_problems(config, document)
    problems += _safety_problems(config.safety, document)
    if problems:
        raise ConfigurationError(problems)
    safety = config.safety
    return dataclasses.replace(
        model,
        bases={name: _slower_base(base, safety) for name, base in model.bases.items()},
        arms={name: _slower_arm(arm, safety) for name, arm in model.arms.items()},
        grippers={name: _weaker_gripper(gripper, safety) for name, gripper in model.grippers.items()},
        connections=connections,
        safety=safety,
    )


def _connections(config: RobotConfig, document: Document) -> tuple[dict[str, ConnectionConfig], list[Problem]]:
    """The connections with their options as the driver's own dataclass."""
    problems: list[Problem] = []
    connections: dict[str, ConnectionConfig] = {}
    for name, connection in config.connections.items():
        try:
            driver: Any = CONNECTIONS.resolve(connection.driver)
        except UnknownNameError as error:
            problems.append(document.problem(("connections", name, "driver"), str(error)))
            continue
        given = document.below("connections", name, "options") if connection.options else Document({})
        try:
            options = check(given, driver.options_type)
        except ConfigurationError as error:
            inside = f"connections.{name}.options"
            problems += [dataclasses.replace(problem, field=f"{inside}.{problem.field}") for problem in error.problems]
            continue
        connections[name] = dataclasses.replace(connection, options=options)
    return connections, problems


def _part_problems(config: RobotConfig, document: Document) -> Iterator[Problem]:
    spoken_for: dict[str, str] = {}
    for name, connection in config.connections.items():
        field = ("connections", name, "parts")
        if not connection.parts:
            yield document.problem(field, "should name at least one part")
        for index, part in enumerate(connection.parts):
            if part not in config.parts:
                yield document.problem((*field, index), f"unknown part; {suggestion(part, list(config.parts))}")
            elif part in spoken_for:
                yield document.problem((*field, index), f"{part!r} is behind connection {spoken_for[part]!r} already")
            spoken_for[part] = name


def _safety_problems(safety: SafetyConfig, document: Document) -> Iterator[Problem]:
    if safety.joint_speed == 0.0:
        yield document.problem(("safety", "joint_speed"), "should be above 0, a share of the arms' speed limits")
    box = safety.workspace
    if box is not None:
        for axis, lower, upper in zip("xyz", box.lower, box.upper, strict=True):
            if lower >= upper:
                message = f"lower {axis} = {lower:g} m should be below upper {axis} = {upper:g} m"
                yield document.problem(("safety", "workspace"), message)


def _slower_arm(arm: ArmModel, safety: SafetyConfig) -> ArmModel:
    velocity: NDArray[np.float64] = arm.velocity * safety.joint_speed
    velocity.setflags(write=False)
    return dataclasses.replace(arm, velocity=velocity)


def _slower_base(base: BaseModel, safety: SafetyConfig) -> BaseModel:
    speed = np.inf if safety.base_speed is None else safety.base_speed
    turn = np.inf if safety.base_turn is None else safety.base_turn
    return dataclasses.replace(
        base, max_vx=min(base.max_vx, speed), max_vy=min(base.max_vy, speed), max_wz=min(base.max_wz, turn)
    )


def _weaker_gripper(gripper: GripperModel, safety: SafetyConfig) -> GripperModel:
    force = np.inf if safety.gripper_force is None else safety.gripper_force
    return dataclasses.replace(gripper, max_force=min(gripper.max_force, force))
