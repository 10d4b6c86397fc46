"""Where somebody puts an object during a run: upright, free, and not where no robot could reach it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bestman_bt.facts.evidence import Evidence
from bestman_bt.facts.standing import is_over, surface_pose
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.runtime import Session
from bestman_bt.scene import PlacedObject, planar_radius
from bestman_bt.scene.placing import gap_to_furniture, gap_to_objects, standing_on
from bestman_bt.scene.plane_geometry import depth_inside, rectangle
from hal.simulation import GroundTruth

EDGE = 0.04
"""Metres between an object and the edge of what it is put on: the map may have that 3 cm elsewhere."""
REACH = 0.35
"""Metres from the front of a surface beyond which nothing is put."""
CLEARANCE = 0.08
"""Metres between an object and what else stands there, and to where the scene wants something to stand."""
HEIGHTS = (0.3, 1.1)
"""Metres above the floor of surfaces that something is carried to."""
TRIES = 200


@dataclass(frozen=True)
class NewPlace:
    """``surface``: ``furniture/name``. ``pose``: of the object in the map frame."""

    surface: str
    pose: Pose


class NewPlaces:
    """Draws places in a world as it is now, open drawers included."""

    def __init__(self, session: Session, truth: GroundTruth) -> None:
        self._evidence = Evidence(session.setup, truth, {})
        self._world, self._map = session.setup.world, session.skills.world.map
        self._models = {placed.name: placed.model for placed in self._world.objects}

    def beside(self, name: str, distance: tuple[float, float], rng: np.random.Generator) -> NewPlace | None:
        """A place on the surface that an object stands on, ``distance`` metres away; None where none was drawn."""
        below = (surface for surface in self._surfaces(inside=True) if is_over(self._evidence, name, surface))
        for surface in below:
            here = (self._map_from(surface).inverse() @ self._evidence.truth.object_pose(name)).position
            for _ in range(TRIES):
                way, direction = rng.uniform(*distance), rng.uniform(-math.pi, math.pi)
                x, y = here[0] + way * math.cos(direction), here[1] + way * math.sin(direction)
                place = self._place(name, surface, float(x), float(y), rng)
                if place is not None:
                    return place
        return None

    def elsewhere(self, name: str, asked: str | None, rng: np.random.Generator) -> NewPlace | None:
        """A place on the surface ``asked`` for, else on any that is open to the room and not of the same furniture."""
        surfaces = list(self._surfaces(inside=False))
        if asked is None:
            below = self._evidence.truth.supports(name)
            surfaces = [surface for surface in surfaces if surface.partition("/")[0] not in below]
        else:
            surfaces = [surface for surface in surfaces if asked in (surface, surface.partition("/")[0])]
        for surface in rng.permutation(surfaces):
            _, _, (length, width), _ = surface_pose(self._evidence, surface)
            for _ in range(TRIES):
                x, y = rng.uniform(-length / 2, length / 2), rng.uniform(-width / 2, width / 2)
                place = self._place(name, str(surface), float(x), float(y), rng)
                if place is not None:
                    return place
        return None

    def _surfaces(self, inside: bool) -> Iterator[str]:
        """Of the map, ``furniture/name``; with ``inside`` also those in drawers and behind doors."""
        for piece in self._map.furniture.values():
            for surface in piece.surfaces:
                name = f"{piece.name}/{surface.name}"
                height = float(self._map_from(name).position[2])
                if inside or (not piece.is_inside(surface) and HEIGHTS[0] < height < HEIGHTS[1]):
                    yield name

    def _map_from(self, surface: str) -> Pose:
        return surface_pose(self._evidence, surface)[1]

    def _place(self, name: str, surface: str, x: float, y: float, rng: np.random.Generator) -> NewPlace | None:
        """At ``x``, ``y`` of a surface (x from its front to its back), turned anyhow; None if that is no good place."""
        piece, map_from_surface, size, room = surface_pose(self._evidence, surface)
        model = self._models[name]
        on_surface = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        pose = standing_on(map_from_surface, on_surface, model)
        reached = x + size[0] / 2 < REACH and float(model.size[2]) < room
        inside = depth_inside(rectangle(Pose2D(), size), on_surface.xy) >= planar_radius(model) + EDGE
        if not (reached and inside):
            return None
        truth = self._evidence.truth
        others = {other: model for other, model in self._models.items() if other != name}
        kept_free = [
            *(PlacedObject(other, model, truth.object_pose(other)) for other, model in others.items()),
            *(PlacedObject(goal, model, there) for goal, there in self._world.goals.items()),
        ]
        gap = min(gap_to_objects(pose, model, kept_free), gap_to_furniture(pose, model, piece, self._world.furniture))
        return NewPlace(surface, pose) if gap >= CLEARANCE else None
