"""Furniture from its YAML: written part by part, or generated from a few options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bestman_bt.configuration.checked import salvage
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import (
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    up_to_unread_field,
)
from bestman_bt.configuration.quantity import (
    Friction,
    JointEffort,
    JointPosition,
    LatchEffort,
    Lengths3,
    Mass,
    Number,
    PositiveLength,
    Size2,
    WholeNumber,
)
from bestman_bt.messages import Handle, HandleKind, JointKind, PlacedShape, Pose
from bestman_bt.messages.handle import HingeSide
from bestman_bt.scene.furniture_generator.generate import generate_furniture, options_of
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.scene import Articulation, FurnitureModel, Surface
from bestman_bt.scene.shape_file import ShapeConfig, placed_shapes

PART_COLOR = (0.7, 0.7, 0.7)  # of parts of furniture that give none

_OUTWARD = np.array([-1.0, 0.0, 0.0])  # the front of furniture faces -x
# furniture_from_handle: z out of the front, x to the right (horizontal) or up (vertical) for who stands before it
_TURNS = {
    "horizontal": np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "vertical": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
}


@dataclass(frozen=True)
class HandleConfig:
    """The handle of a door or drawer; see bestman_bt.messages.Handle. Its shapes are among the ``parts``.

    ``xyz``: middle of the gripped part, in the furniture frame. ``panel``, ``panel_size``: middle of the front panel
    and its width and height.
    """

    kind: HandleKind
    xyz: Lengths3
    radius: PositiveLength
    length: PositiveLength
    panel: Lengths3
    panel_size: Size2
    direction: Literal["horizontal", "vertical"] = "horizontal"


@dataclass(frozen=True)
class ArticulationConfig:
    """A door (``revolute``) or drawer (``prismatic``), closed, in the furniture frame.

    ``origin``: a point on the ``axis``; a positive motion opens the joint up to ``upper``. ``friction``: N m or N.
    ``latch``: additional resistance at the closed position.
    """

    joint: JointKind
    origin: Lengths3
    axis: tuple[Number, Number, Number]
    upper: JointPosition
    parts: tuple[ShapeConfig, ...]
    mass: Mass
    friction: JointEffort
    handle: HandleConfig
    latch: LatchEffort = 0.0


def read_articulations(configs: Mapping[str, ArticulationConfig], document: Document) -> tuple[Articulation, ...]:
    """Return the articulations of a furniture file. Raises ConfigurationError listing every fault."""
    faults, read = ProblemCollector(), []
    for name, config in configs.items():
        problems = [*_joint_faults(name, config, document), *_handle_faults(name, config, document)]
        faults.problems += problems
        with faults.step():
            parts = _shapes_of(name, config, document)
            if not problems:
                read.append(_articulation(name, config, parts))
    faults.raise_if_any()
    return tuple(read)


def _joint_faults(name: str, config: ArticulationConfig, document: Document) -> Iterator[Problem]:
    within = document.below("articulations", name).data
    path = ("articulations", name)
    if within.get("parts") == []:
        yield document.problem((*path, "parts"), "a door or drawer needs at least one shape")
    with suppress(UnreadError):
        if config.upper <= 0.0:
            message = f"should be more than 0, got {config.upper:g}; the joint opens from 0 to here"
            yield document.problem((*path, "upper"), message)
    with suppress(UnreadError):
        if not np.linalg.norm(config.axis) > 0.0:
            yield document.problem((*path, "axis"), f"should not be zero, got {list(config.axis)}")


@up_to_unread_field
def _handle_faults(name: str, config: ArticulationConfig, document: Document) -> Iterator[Problem]:
    path, pulled = ("articulations", name), _pulled(config)
    if not np.linalg.norm(config.axis) > 0.0:
        return
    if not np.linalg.norm(pulled) > 1e-6:
        message = f"the handle lies on the axis, which goes through {list(config.origin)}"
        yield document.problem((*path, "origin"), message)
    elif pulled @ _OUTWARD <= 0.0:
        turned = [float(-a) for a in config.axis]
        yield document.problem(
            (*path, "axis"), f"the joint opens inwards, but the front faces -x; reverse the axis: {turned}"
        )


def _pulled(config: ArticulationConfig) -> np.ndarray:
    """Return the direction in which the handle moves when the joint opens, not of unit length."""
    axis = np.array(config.axis) / (np.linalg.norm(config.axis) or 1.0)
    if config.joint == "prismatic":
        return axis
    moved: np.ndarray = np.cross(axis, np.array(config.handle.xyz) - np.array(config.origin))
    return moved


def _shapes_of(name: str, config: ArticulationConfig, document: Document) -> tuple[PlacedShape, ...]:
    try:
        return placed_shapes(config.parts, document.below("articulations", name), "parts")
    except UnreadError:
        return ()
    except ConfigurationError as error:
        raise error.within("articulations", name) from error


def _articulation(name: str, config: ArticulationConfig, parts: tuple[PlacedShape, ...]) -> Articulation:
    axis, origin, pulled = np.array(config.axis) / np.linalg.norm(config.axis), np.array(config.origin), _pulled(config)
    pulled = pulled / np.linalg.norm(pulled)
    return Articulation(
        name=name,
        kind=config.joint,
        origin=config.origin,
        axis=(float(axis[0]), float(axis[1]), float(axis[2])),
        upper=config.upper,
        parts=parts,
        colors=tuple((*(part.color or PART_COLOR), 1.0) for part in config.parts),
        mass=config.mass,
        friction=config.friction,
        handle=_handle(config, origin, axis, pulled),
        latch=config.latch,
    )


def _handle(config: ArticulationConfig, origin: np.ndarray, axis: np.ndarray, pulled: np.ndarray) -> Handle:
    given = config.handle
    revolute = config.joint == "revolute"
    return Handle(
        kind=given.kind,
        pose=_facing(given.xyz, given.direction),
        radius=given.radius,
        length=given.length,
        standoff=given.panel[0] - given.xyz[0],
        opening_direction=pulled,
        confidence=1.0,
        position_std=0.0,
        joint=config.joint,
        joint_confidence=1.0,
        hinge_side=_hinge_side(np.array(given.xyz), origin, axis) if revolute else None,
        hinge=origin if revolute else None,
        hinge_direction=axis if revolute else None,
        panel=_facing(given.panel, "horizontal"),
        panel_size=given.panel_size,
    )


def _facing(xyz: Lengths3, direction: str) -> Pose:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = _TURNS[direction], xyz
    return Pose.from_matrix(matrix)


def _hinge_side(handle: np.ndarray, origin: np.ndarray, axis: np.ndarray) -> HingeSide:
    """Return on which side of the handle the hinge axis is, seen from the front, where -y is to the right."""
    away = origin - handle
    away = away - (away @ axis) * axis
    if abs(away[1]) >= abs(away[2]):
        return "left" if away[1] > 0.0 else "right"
    return "top" if away[2] > 0.0 else "bottom"


@dataclass(frozen=True)
class SurfaceConfig:
    """A horizontal rectangle centred at ``xyz`` in the furniture frame."""

    xyz: Lengths3
    size: Size2


@dataclass(frozen=True)
class FurnitureFile:
    """A piece of furniture; its frame is on the floor in the middle of the footprint, the front faces -x.

    ``articulations``: doors and drawers.
    """

    footprint: Size2
    parts: tuple[ShapeConfig, ...]
    surfaces: Mapping[str, SurfaceConfig] = field(default_factory=dict)
    articulations: Mapping[str, ArticulationConfig] = field(default_factory=dict)
    friction: Friction = 0.8
    description: str = ""


@dataclass(frozen=True)
class GeneratedFurnitureFile:
    """Generated furniture: ``generate`` has its ``kind`` and fixed options.

    ``seed``: determines all other options.
    """

    generate: Mapping[str, Any]
    seed: WholeNumber = 0
    description: str = ""


def read_furniture(name: str | Path, asked_by: Problem | None = None) -> FurnitureModel:
    """Return the furniture of a shipped name or a file; raises ConfigurationError."""
    path = find_data("furniture", name, asked_by)
    document = read_document(path)
    return (_generated if "generate" in document.data else _written)(path.stem, document)


def _written(name: str, document: Document) -> FurnitureModel:
    file, problems = salvage(document, FurnitureFile)
    faults = ProblemCollector(problems)
    parts: tuple[PlacedShape, ...] = ()
    articulations: tuple[Articulation, ...] = ()
    with faults.step():
        parts = placed_shapes(file.parts, document, "parts")
    with faults.step():
        articulations = read_articulations(file.articulations, document)
    faults.raise_if_any()
    return FurnitureModel(
        name=name,
        footprint=file.footprint,
        parts=parts,
        colors=tuple((*(part.color or PART_COLOR), 1.0) for part in file.parts),
        surfaces=tuple(Surface(key, Pose.from_xyz_rpy(s.xyz), s.size) for key, s in file.surfaces.items()),
        friction=file.friction,
        articulations=articulations,
    )


def _generated(name: str, document: Document) -> FurnitureModel:
    file, problems = salvage(document, GeneratedFurnitureFile)
    faults = ProblemCollector(problems)
    with faults.step():
        model = _from_options(name, file, document, faults)
    faults.raise_if_any()
    return model


def _from_options(
    name: str, file: GeneratedFurnitureFile, document: Document, faults: ProblemCollector
) -> FurnitureModel:
    kind = file.generate.get("kind")
    try:
        if not isinstance(kind, str):
            raise FurnitureOptionError(("kind",), "is missing" if kind is None else f"should be a name, got {kind!r}")
        below = document.below("generate")
        options_type: Any = options_of(kind)
        wanted = {key: value for key, value in below.data.items() if key != "kind"}
        options, problems = salvage(Document(wanted, below.origins), options_type)
        faults.problems += ConfigurationError(problems).within("generate").problems
        given = {option.name: getattr(options, option.name) for option in fields(options_type)}
        return generate_furniture(kind, np.random.default_rng(file.seed), name, **given)
    except FurnitureOptionError as error:
        raise ConfigurationError([document.problem(("generate", *error.path), error.reason)]) from error
