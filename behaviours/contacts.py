"""Intended contacts, declared by skills for their duration; all other contacts are collisions."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bestman_bt.messages import Pose
from bestman_bt.registry import suggestion
from bestman_bt.world_model.world_model import WorldModel

FLOOR = "floor"
BESIDE = 0.05
"""Metres beyond the mapped rectangle of a surface within which an object still counts as standing on it."""

MAX_FORCE = 200.0
"""Limit of the force of a contact if a skill gives none, newtons."""
STOPPING = 100.0
"""Newtons by which a contact may exceed the force at which a motion ends, while arm and load are braked."""
MOST_FORCE = 600.0
"""Largest force that a skill may declare, newtons: six times that of the strongest shipped gripper, 100 N."""


@dataclass(frozen=True, eq=False)
class Contact:
    """An intended contact of a skill.

    ``kind``: ``grasp`` and ``push``: the fingers touch the object ``thing``; ``support``: the object ``thing`` touches
    the furniture ``on``, or the ``floor``; ``handle``: the fingers touch the door or drawer ``thing``,
    ``furniture/name``, or its handle. ``max_force``: newtons. ``skill``: path of the node, set by ``Skill.touching``.
    """

    kind: Literal["grasp", "push", "support", "handle"]
    thing: str
    max_force: float
    on: str = ""
    skill: str = ""

    def fault(self, objects: Collection[str], articulations: Collection[str]) -> str:
        """Return why the declaration is invalid, and what is accepted; empty if it is valid.

        ``objects``: the names known to the robot. ``articulations``: the doors and drawers of its map; if it has none,
        as during exploration, any name is accepted.
        """
        if not 0.0 < self.max_force <= MOST_FORCE:
            return f"max_force should be more than 0 and at most {MOST_FORCE:g} N, got {self.max_force:g}"
        if self.kind != "handle" and self.thing not in objects:
            return f"it should name one object that the robot knows, got {self.thing!r}; " + suggestion(
                self.thing, list(objects)
            )
        if self.kind == "handle" and "/" not in self.thing:
            return f"it should name one door or drawer, 'furniture/name', got {self.thing!r}"
        if self.kind == "handle" and articulations and self.thing not in articulations:
            return f"it should name one door or drawer of the map, got {self.thing!r}; " + suggestion(
                self.thing, list(articulations)
            )
        return ""


def stopping_at(force: float) -> float:
    """Return the limit to declare for motions or hands that press with ``force`` newtons at most, until they stop."""
    return min(force + STOPPING, MOST_FORCE)


def grasp(thing: str, max_force: float = MAX_FORCE) -> Contact:
    """Declare that the fingers grasp, hold or release an object; ``max_force``: newtons."""
    return Contact("grasp", thing, max_force)


def push(thing: str, max_force: float = MAX_FORCE) -> Contact:
    """Declare that the fingers push an object; ``max_force``: newtons."""
    return Contact("push", thing, max_force)


def handle(articulation: str, max_force: float = MAX_FORCE) -> Contact:
    """Declare that the fingers pull or push a door or drawer, ``furniture/name``; ``max_force``: newtons."""
    return Contact("handle", articulation, max_force)


def support(thing: str, surface: str, max_force: float = MAX_FORCE) -> Contact:
    """Declare that a held object leaves or reaches its support: a surface or a piece of furniture of the map.

    ``max_force``: newtons.
    """
    return Contact("support", thing, max_force, surface.partition("/")[0])


def surface_below(world: WorldModel, map_from_object: Pose) -> str:
    """Return the mapped surface below an object at a pose, or ``floor``."""
    below: list[tuple[float, str]] = []
    for piece in world.map.furniture.values():
        for mapped in piece.surfaces:
            name = f"{piece.name}/{mapped.name}"
            _, surface = world.surface(name)
            x, y, z = ((piece.pose.to_pose() @ surface.pose).inverse() @ map_from_object).position
            if (np.abs((x, y)) <= np.array(surface.size) / 2 + BESIDE).all() and z > -BESIDE:
                below.append((float(z), name))
    return min(below)[1] if below else FLOOR
