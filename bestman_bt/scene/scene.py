"""Scenes: descriptions of worlds, before and after the random draw, with walking people and moving doors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from bestman_bt.messages import Box, Handle, JointKind, ObjectModel, PlacedShape, Pose, Pose2D, joint_motion


@dataclass(frozen=True)
class MovingDoor:
    """A door that moves to the opening ``to``, radians, when the robot is within ``within`` metres of its frame's
    middle.

    ``articulation``: ``furniture/name``. ``speed``: rad/s. ``torque``: largest pushing torque beyond the friction of
    the hinge, N m.
    """

    articulation: str
    to: float
    within: float
    speed: float
    torque: float


@dataclass(frozen=True)
class Walker:
    """A person that walks along ``route``, a closed polygon in the map frame, metres, from its first point, endlessly.

    ``radius``, ``height`` in metres, ``mass`` in kilograms, ``speed`` in m/s. ``considerate``: it stops for the robot
    and other walkers; otherwise it walks on.
    """

    name: str
    radius: float
    height: float
    mass: float
    speed: float
    route: tuple[tuple[float, float], ...]
    considerate: bool = True


LATCH_TRAVEL = {"revolute": math.radians(1.5), "prismatic": 0.008}
"""Opening up to which a latch holds, radians or metres."""


@dataclass(frozen=True)
class Wall:
    """A straight wall from ``start`` to ``end`` (x, y) metres in the map frame; exact in the map."""

    start: tuple[float, float]
    end: tuple[float, float]
    height: float
    thickness: float


@dataclass(frozen=True)
class Surface:
    """A horizontal rectangle for objects; ``pose``: of its centre in the furniture frame; ``size``: (x, y) m."""

    name: str
    pose: Pose
    size: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Articulation:
    """A door or drawer in the furniture frame, closed.

    ``origin``: (3,) metres, a point on the axis; ``axis``: (3,) unit; a positive motion opens the joint, from 0 to
    ``upper`` (radians or metres). ``friction``: N m or N. ``handle``: its true handle. ``surfaces``: those that move
    with it, such as a drawer's bottom. ``latch``: N m or N in addition to friction at the closed position, over the
    first ``LATCH_TRAVEL``.
    """

    name: str
    kind: JointKind
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    upper: float
    parts: tuple[PlacedShape, ...]
    colors: tuple[tuple[float, float, float, float], ...]
    mass: float
    friction: float
    handle: Handle
    surfaces: tuple[Surface, ...] = ()
    latch: float = 0.0

    def moved(self, position: float) -> Pose:
        """Return furniture_from_closed at an opening of ``position``, radians or metres."""
        return joint_motion(self.kind, self.origin, self.axis, position)


@dataclass(frozen=True)
class FurnitureModel:
    """A piece of furniture; its frame is on the floor at the centre of the footprint, the front faces -x.

    ``footprint``: (x, y) extents in metres. ``parts``: fixed solid shapes, with rgba colours. ``is_passage``: a door
    between rooms.
    """

    name: str
    footprint: tuple[float, float]
    parts: tuple[PlacedShape, ...]
    colors: tuple[tuple[float, float, float, float], ...]
    surfaces: tuple[Surface, ...]
    friction: float = 0.8
    articulations: tuple[Articulation, ...] = ()
    is_passage: bool = False

    @property
    def all_surfaces(self) -> tuple[Surface, ...]:
        """The surfaces of the body, then those of its closed drawers."""
        return (*self.surfaces, *(s for door in self.articulations for s in door.surfaces))

    def drawer_of(self, surface: str) -> Articulation | None:
        """Return the drawer that a surface moves with, or None."""
        return next((door for door in self.articulations if surface in {s.name for s in door.surfaces}), None)


@dataclass(frozen=True)
class PlacedFurniture:
    """Furniture in a world: its mapped pose (``nominal``) and true pose (``actual``).

    ``elevation``: metres above the floor, of a piece on another one, ``on``. ``open``: initial openings of its doors
    and drawers, radians or metres by name; others are closed. ``mapped``: whether the semantic map has it.
    ``mapped_open``: mapped openings, like ``open``.
    """

    name: str
    model: FurnitureModel
    nominal: Pose2D
    actual: Pose2D
    elevation: float = 0.0
    on: str | None = None
    open: Mapping[str, float] = field(default_factory=dict)
    mapped: bool = True
    mapped_open: Mapping[str, float] = field(default_factory=dict)

    @property
    def pose(self) -> Pose:
        """The true pose, map_from_furniture."""
        return self.actual.to_pose(self.elevation)

    def surface_pose(self, surface: Surface) -> Pose:
        """Return the initial pose of one of its surfaces, map_from_surface."""
        door = self.model.drawer_of(surface.name)
        moved = Pose() if door is None else door.moved(self.open.get(door.name, 0.0))
        return self.pose @ moved @ surface.pose


@dataclass(frozen=True)
class PlacedObject:
    """A movable object at ``pose`` in the map frame."""

    name: str
    model: ObjectModel
    pose: Pose


@dataclass(frozen=True)
class World:
    """One drawn scene: everything for the simulator, and for evaluation.

    ``goals``: name → pose in the map frame, such as a place pose of the task; ``goal_heights``: of the model of each,
    metres; ``goal_surfaces``: the surface of each. ``finger_friction``: overrides the gripper's own if not None (for
    control experiments).
    """

    scene: str
    seed: int
    walls: tuple[Wall, ...]
    furniture: tuple[PlacedFurniture, ...]
    objects: tuple[PlacedObject, ...]
    robot_start: Pose2D
    goals: Mapping[str, Pose]
    finger_friction: float | None = None
    goal_heights: Mapping[str, float] = field(default_factory=dict)
    goal_surfaces: Mapping[str, str] = field(default_factory=dict)
    walkers: tuple[Walker, ...] = ()
    moving_doors: tuple[MovingDoor, ...] = ()


def wall_box(wall: Wall) -> tuple[Box, Pose]:
    """Return the wall as a box, metres, and its pose in the map frame."""

    dx, dy = wall.end[0] - wall.start[0], wall.end[1] - wall.start[1]
    length = math.hypot(dx, dy)
    centre = ((wall.start[0] + wall.end[0]) / 2, (wall.start[1] + wall.end[1]) / 2, wall.height / 2)
    return (
        Box((length + wall.thickness, wall.thickness, wall.height)),
        Pose.from_xyz_rpy(centre, (0.0, 0.0, math.atan2(dy, dx))),
    )
