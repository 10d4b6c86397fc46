"""Contacts that skills are about to make, declared by name while they last; everything else is a collision."""

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
"""Metres beyond the mapped rectangle of a surface at which something still counts as standing on it."""

MAX_FORCE = 200.0
"""Newtons that a finger and an object, or an object and its support, may press on each other by default."""
MAX_HANDLE_FORCE = 600.0
"""Newtons on a door or drawer by default: an end stop pushes back hard for a moment."""
MOST_FORCE = 600.0
"""Newtons that no skill may declare more than: six times what the strongest gripper that is shipped presses, 100 N."""


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact that a skill is about to make.

    ``kind``: what presses on what: ``grasp`` and ``push``: the fingers on the object ``thing``; ``support``: the object
    ``thing`` on the furniture ``on``, or on the ``floor``; ``handle``: the fingers on the door or drawer ``thing``,
    ``furniture/leaf``, or its handle. ``max_force``: newtons. ``skill``: path of the node, which ``Skill.touching``
    fills in.
    """

    kind: Literal["grasp", "push", "support", "handle"]
    thing: str
    max_force: float
    on: str = ""
    skill: str = ""

    def fault(self, objects: Collection[str], articulations: Collection[str]) -> str:
        """What is wrong with the declaration, and what would be right; empty where nothing is.

        ``objects``: the names that the robot knows. ``articulations``: the doors and drawers of its map; any name will
        do where it has none, as in a world that is explored.
        """
        if not 0.0 < self.max_force <= MOST_FORCE:
            return f"max_force should be more than 0 and at most {MOST_FORCE:g} N, got {self.max_force:g}"
        if self.kind != "handle" and self.thing not in objects:
            return f"it should name one object that the robot knows, got {self.thing!r}; " + suggestion(
                self.thing, list(objects)
            )
        if self.kind == "handle" and "/" not in self.thing:
            return f"it should name one door or drawer, 'furniture/leaf', got {self.thing!r}"
        if self.kind == "handle" and articulations and self.thing not in articulations:
            return f"it should name one door or drawer of the map, got {self.thing!r}; " + suggestion(
                self.thing, list(articulations)
            )
        return ""


def grasp(thing: str, max_force: float = MAX_FORCE) -> Contact:
    """The fingers take, hold or let go of an object."""
    return Contact("grasp", thing, max_force)


def push(thing: str, max_force: float = MAX_FORCE) -> Contact:
    """The fingers push an object."""
    return Contact("push", thing, max_force)


def handle(articulation: str, max_force: float = MAX_HANDLE_FORCE) -> Contact:
    """The fingers pull or push at a door or drawer, ``furniture/leaf``."""
    return Contact("handle", articulation, max_force)


def support(thing: str, surface: str, max_force: float = MAX_FORCE) -> Contact:
    """An object in the hand leaves or reaches what it stands on: a surface or a piece of furniture of the map."""
    return Contact("support", thing, max_force, surface.partition("/")[0])


def surface_below(world: WorldModel, map_from_object: Pose) -> str:
    """The mapped surface on which something at a pose stands; ``floor`` where there is none below it."""
    below: list[tuple[float, str]] = []
    for piece in world.map.furniture.values():
        for mapped in piece.surfaces:
            name = f"{piece.name}/{mapped.name}"
            _, surface = world.surface(name)
            x, y, z = ((piece.pose.to_pose() @ surface.pose).inverse() @ map_from_object).position
            if (np.abs((x, y)) <= np.array(surface.size) / 2 + BESIDE).all() and z > -BESIDE:
                below.append((float(z), name))
    return min(below)[1] if below else FLOOR
