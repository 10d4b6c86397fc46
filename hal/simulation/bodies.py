"""Data of an engine about its bodies: numbers by name, contacts, motions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import InputError
from bestman_bt.messages import Pose
from bestman_bt.scene.scene import World
from hal.api import RobotError

Array = NDArray[np.float64]
Found = TypeVar("Found")
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""xyzw."""
JointStates = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""Positions, velocities, efforts of motors."""


class SimulationError(RobotError):
    """Raised if the physics engine refused a call, or a body does not exist."""


class RefusedPartError(SimulationError, InputError):
    """A robot has a part that an engine does not simulate."""


@dataclass(frozen=True)
class BuiltWorld:
    """Bodies by name, and the robot's joints and links by name (its root link is -1), with the engine's numbers.

    ``frames``: frames of the robot that are not links here: frame → (link, link_from_frame). ``articulations``: doors
    and drawers, ``furniture/name`` → body and joint, which is also the link's number. ``walkers``: body and the joints
    of its slides. ``parents``: link of the robot → its parent link. Masses in kilograms, those of objects by body.
    ``max_efforts``: of the robot's joints, N m or N; 0: unlimited.
    """

    floor: int
    walls: dict[str, int]
    furniture: dict[str, int]
    objects: dict[str, int]
    robot: int
    joints: dict[str, int]
    links: dict[str, int]
    frames: dict[str, tuple[str, Pose]]
    parents: dict[int, int]
    link_masses: dict[int, float]
    object_masses: dict[int, float]
    max_efforts: dict[int, float]
    articulations: dict[str, tuple[int, int]] = field(default_factory=dict)
    walkers: dict[str, tuple[int, tuple[int, int]]] = field(default_factory=dict)

    @property
    def body_names(self) -> dict[int, str]:
        """Names of all bodies but the robot, by number."""
        names = {self.floor: "floor"}
        for bodies in (self.walls, self.furniture, self.objects):
            names |= {body: name for name, body in bodies.items()}
        names |= {body: name for name, (body, _) in self.walkers.items()}
        return names

    def below(self, joints: Iterable[str]) -> list[int]:
        """Return the robot's links below the joints of these names, in ascending order."""
        carried = {self.joints[joint] for joint in joints}
        for link, parent in sorted(self.parents.items()):  # parents come before children
            if parent in carried:
                carried.add(link)
        return sorted(carried)


def check_names(world: World) -> None:
    """Raise SimulationError if two bodies share a name."""
    names = ["floor", "robot", *(f.name for f in world.furniture), *(o.name for o in world.objects)]
    names += [walker.name for walker in world.walkers]
    if len(set(names)) < len(names):
        raise SimulationError(f"bodies of a world need unique names, but got {', '.join(sorted(names))}")


def among(bodies: Mapping[str, Found], name: str, kind: str) -> Found:
    """Return the object of the world with ``name``. Raises SimulationError that lists the names."""
    if name not in bodies:
        raise SimulationError(f"there is no {kind} {name!r}; there is {', '.join(bodies) or 'none'}")
    return bodies[name]


class BodyState(NamedTuple):
    """Pose of the centre of mass of a body's root link in the map frame, and its velocity (m/s, rad/s)."""

    position: Vector
    quaternion: Quaternion
    linear: Vector
    angular: Vector


class LinkMotion(NamedTuple):
    """The motion of a link's centre of mass, in the map frame: metres, m/s, rad/s."""

    position: Vector
    linear: Vector
    angular: Vector


class ContactPoint(NamedTuple):
    """A contact point of two bodies that touch or nearly do; metres, newtons and unit vectors in the map frame.

    ``normal``: normal of the second body, towards the first. ``distance``: negative if they overlap. Forces on the
    first body: ``pressure`` along the normal, ``friction`` along ``direction`` and ``friction_2`` along
    ``direction_2``.
    """

    first: int
    second: int
    first_link: int
    second_link: int
    on_first: Vector
    on_second: Vector
    normal: Vector
    distance: float
    pressure: float
    friction: float
    direction: Vector
    friction_2: float
    direction_2: Vector

    def force(self) -> Vector:
        """Return the total force on the first body, (3,) newtons."""
        (a, b, c), (d, e, f), (g, h, i) = self.normal, self.direction, self.direction_2
        press, slip, slip_2 = self.pressure, self.friction, self.friction_2
        return press * a + slip * d + slip_2 * g, press * b + slip * e + slip_2 * h, press * c + slip * f + slip_2 * i


@dataclass(frozen=True)
class Viewpoint:
    """The viewpoint of a picture: ``eye`` and ``target`` in the map frame, metres; vertical field of view in degrees.

    ``near``: near clipping distance, metres.
    """

    eye: Vector
    target: Vector
    field_of_view: float = 50.0
    light_direction: Vector = (-2.0, -3.0, 6.0)
    near: float = 0.05
