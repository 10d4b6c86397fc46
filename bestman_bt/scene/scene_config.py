"""The YAML of scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.quantity import (
    Angle,
    AngularSpeed,
    Distance,
    Friction,
    JointPosition,
    Length,
    Mass,
    PositiveLength,
    PositiveWholeNumber,
    Share,
    SmallerFirst,
    Speed,
    Torque,
)
from bestman_bt.messages import ObjectModel
from bestman_bt.registry import suggestion
from bestman_bt.scene.apartment_generator.options import ApartmentOptions
from bestman_bt.scene.scene import FurnitureModel, Surface

_TWO_DEGREES = math.radians(2.0)
Point2 = tuple[Length, Length]
Range = Annotated[tuple[Length, Length], SmallerFirst]


def _two_ends(line: tuple[Point2, Point2]) -> tuple[Point2, Point2]:
    if line[0] == line[1]:
        raise PydanticCustomError("line", "a wall needs two different ends")
    return line


@dataclass(frozen=True)
class RegionConfig:
    """A rectangle to sample in: x and y in metres, yaw in radians."""

    x: Range
    y: Range
    yaw: Annotated[tuple[Angle, Angle], SmallerFirst] = (-math.pi, math.pi)


@dataclass(frozen=True)
class WallsConfig:
    """Straight walls by the ends of their centre lines, in the map frame."""

    height: PositiveLength
    thickness: PositiveLength
    lines: tuple[Annotated[tuple[Point2, Point2], AfterValidator(_two_ends)], ...]


@dataclass(frozen=True)
class FurniturePlacement:
    """``model``: the furniture's file; ``at``: x, y, yaw in the map, or on the surface ``on``.

    The true pose is within ``offset`` metres (each axis) and ``turn`` radians of it. ``on``: a surface of furniture
    listed above (``counter/top``); None: the floor. ``open``: initial openings of doors and drawers, by name;
    ``mapped_open``: mapped openings. ``moved``: metres each way within which it was moved, with any rotation, after the
    map was made; 0: not moved.
    """

    model: str
    at: tuple[Length, Length, Angle]
    on: str | None = None
    offset: Distance = 0.03
    turn: Angle = _TWO_DEGREES
    open: Mapping[str, JointPosition] = field(default_factory=dict)
    mapped_open: Mapping[str, JointPosition] = field(default_factory=dict)
    moved: Distance = 0.0


@dataclass(frozen=True)
class ObjectPlacement:
    """An object on ``surface`` (``table/top``): somewhere in ``region`` or exactly ``at`` x, y, yaw (surface frame).

    ``presence``: probability that it is present.
    """

    model: str
    surface: str
    region: RegionConfig | None = None
    at: tuple[Length, Length, Angle] | None = None
    presence: Share = 1.0


@dataclass(frozen=True)
class GoalPlacement:
    """A target pose: an object of ``model`` on ``surface`` within ``region`` (surface frame).

    ``margin``: metres from the surface's edges, true and mapped. ``clearance``: metres of free space around the object
    in the drawn world; None: objects may be there.
    """

    model: str
    surface: str
    region: RegionConfig
    margin: Distance = 0.1
    clearance: Distance | None = 0.12


@dataclass(frozen=True)
class UnmappedPlacement:
    """Furniture that the map lacks: exactly at ``at``, x, y, yaw in the map frame, or somewhere in ``region``.

    Without either, anywhere in the start region. ``open``: as for other furniture. ``presence``: probability.
    """

    model: str
    region: RegionConfig | None = None
    at: tuple[Length, Length, Angle] | None = None
    open: Mapping[str, JointPosition] = field(default_factory=dict)
    presence: Share = 1.0


@dataclass(frozen=True)
class WalkersConfig:
    """People: ``count`` cylinders with ranges of ``speed`` and ``radius``, ``height`` and ``mass``.

    Each walks in a loop over ``stops`` points drawn by the seed, or over ``way_points``, metres in the map frame.
    ``considerate``: whether they stop for the robot.
    """

    count: PositiveWholeNumber
    speed: Annotated[tuple[Speed, Speed], SmallerFirst] = (0.3, 0.8)
    radius: Annotated[tuple[PositiveLength, PositiveLength], SmallerFirst] = (0.2, 0.25)
    height: PositiveLength = 1.7
    mass: Mass = 70.0
    stops: Annotated[int, Field(strict=True, ge=2)] = 4
    way_points: tuple[Point2, ...] | None = None
    considerate: bool = True


@dataclass(frozen=True)
class MovingDoorConfig:
    """A door that moves to the opening ``to`` once the robot is ``within`` metres of the middle of its frame.

    ``speed``: rad/s. ``torque``: largest pushing torque beyond the friction of its hinge, N m.
    """

    to: Angle
    within: PositiveLength
    speed: AngularSpeed = 0.6
    torque: Torque = 4.0


@dataclass(frozen=True)
class GeneratorConfig:
    """The generator of walls and furniture."""

    apartment: ApartmentOptions


@dataclass(frozen=True)
class SceneFile:
    """A scene.

    ``generator``: makes ``walls``, ``furniture`` and, by default, the region of ``robot_start``, which other scenes
    must give. ``unmapped``: furniture that the map lacks. ``moving_doors``: by ``furniture/door``. ``clearance``:
    metres between objects, so that a hand fits. ``start_clearance``: metres from the robot's frame to walls and
    furniture. ``passage``: radius in metres of a disc that must reach all of an apartment: a base that turns in place.
    ``finger_friction``: replaces the gripper's own, for control experiments.
    """

    walls: WallsConfig | None = None
    furniture: Mapping[str, FurniturePlacement] = field(default_factory=dict)
    objects: Mapping[str, ObjectPlacement] = field(default_factory=dict)
    robot_start: RegionConfig | None = None
    generator: GeneratorConfig | None = None
    unmapped: Mapping[str, UnmappedPlacement] = field(default_factory=dict)
    walkers: WalkersConfig | None = None
    moving_doors: Mapping[str, MovingDoorConfig] = field(default_factory=dict)
    goals: Mapping[str, GoalPlacement] = field(default_factory=dict)
    clearance: Distance = 0.08
    start_clearance: Distance = 0.45
    passage: PositiveLength = 0.37
    finger_friction: Friction | None = None
    extends: str | None = None
    description: str = ""


@dataclass(frozen=True)
class SceneConfig:
    """A scene before the random draw.

    ``furniture``: model of each piece by name. ``models``: object models that the robot may know: of each object by its
    name, and of each goal's object by the model's name. ``goal_models``: by the goal's name. ``unmapped``: models of
    the unmapped furniture. ``absent``: names of furniture and objects removed from an extended scene. ``unread_base``:
    whether an extended scene could not be read, so that unknown names may exist. ``document``: places of the values.
    """

    name: str
    file: SceneFile
    furniture: Mapping[str, FurnitureModel]
    models: Mapping[str, ObjectModel]
    goal_models: Mapping[str, ObjectModel]
    unmapped: Mapping[str, FurnitureModel] = field(default_factory=dict)
    absent: tuple[str, ...] = ()
    unread_base: bool = False
    document: Document = field(default_factory=lambda: Document({}), compare=False, repr=False)

    def surface(self, name: str) -> tuple[str, Surface]:
        """Return furniture name and surface for ``furniture`` or ``furniture/surface``.

        Raises KeyError listing the known ones.
        """
        furniture, _, wanted = name.partition("/")
        for surface in self.furniture[furniture].all_surfaces if furniture in self.furniture else ():
            if wanted in ("", surface.name):
                return furniture, surface
        known = [f"{piece}/{surface.name}" for piece, model in self.furniture.items() for surface in model.all_surfaces]
        raise KeyError(f"unknown surface {name!r}; {suggestion(name, known)}")
