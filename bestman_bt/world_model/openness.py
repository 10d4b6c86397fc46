"""Thresholds for open doors and drawers, and their geometry at the believed opening."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import Box, Handle, JointKind, PlacedShape, Pose
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture, MapSurface
from bestman_bt.world_model.world_model import Obstacle, WorldModel


def articulation_shapes(
    world_model: WorldModel, furniture: MapFurniture, door: MapArticulation
) -> tuple[PlacedShape, ...]:
    """Return the boards of a door or drawer at its believed opening, in the furniture frame."""
    opened = world_model.opening_of(furniture, door)
    return tuple(PlacedShape(shape.shape, opened @ shape.pose) for shape in door.shapes)


def articulation_obstacles(world_model: WorldModel) -> tuple[Obstacle, ...]:
    """Return the open doors and drawers with their handles as obstacles named ``furniture/name``.

    Doors between rooms are always included, even closed, because they can block a passage.
    """
    obstacles = []
    for piece in world_model.map.furniture.values():
        for door in piece.articulations:
            name = f"{piece.name}/{door.name}"
            if piece.is_passage or world_model.articulations.get(name, 0.0) > 0.0:
                frame = piece.pose.to_pose()
                boards = [PlacedShape(s.shape, frame @ s.pose) for s in articulation_shapes(world_model, piece, door)]
                handles = [handle_shape(belief.handle) for belief in world_model.handles_of(piece, door)]
                obstacles.append(Obstacle(name, (*boards, *handles), 0.0))
    return tuple(obstacles)


def handle_shape(handle: Handle) -> PlacedShape:
    """Return a box from the front to beyond the handle, in the handle's frame of reference."""
    thickness = 2.0 * handle.radius
    depth = max(handle.standoff, 0.0) + handle.radius
    middle = Pose(np.array([0.0, 0.0, handle.radius - depth / 2]))
    return PlacedShape(Box((max(handle.length, thickness), thickness, depth)), handle.pose @ middle)


OPEN: dict[JointKind, tuple[float, float]] = {"prismatic": (0.25, 0.28), "revolute": (1.40, 1.45)}
"""Metres or radians: smallest opening to work behind a door, and the target when opening it."""
SHUT: dict[JointKind, float] = {"prismatic": 0.02, "revolute": 0.035}
"""Metres or radians up to which a door counts as shut."""
NEARLY_ALL = 0.95
"""Largest fraction of its range to which a door is opened."""
ENOUGH = 0.9
"""Fraction of the target that suffices if a door does not open any further."""


@dataclass(frozen=True)
class Openness:
    """Openings of a door or drawer, metres or radians. ``enough``: to work behind it. ``asked``: target of opening.
    ``shut``: largest opening that counts as shut.
    """

    enough: float
    asked: float
    shut: float


def openness_of(door: MapArticulation) -> Openness:
    """Return the thresholds of a door or drawer."""
    enough, asked = OPEN[door.kind]
    asked = min(asked, NEARLY_ALL * door.upper)
    return Openness(min(enough, ENOUGH * asked), asked, SHUT[door.kind])


def articulation_called(world: WorldModel, container: str) -> MapArticulation:
    """Return the door or drawer ``furniture/name``. Raises KeyError if there is none."""
    furniture, _, name = container.partition("/")
    return world.map.furniture[furniture].articulation(name)


def is_open(world: WorldModel, container: str) -> bool:
    """Return whether the door or drawer is believed to be open far enough to work behind it."""
    return world.articulations.get(container, 0.0) >= openness_of(articulation_called(world, container)).enough


def is_shut(world: WorldModel, container: str) -> bool:
    """Return whether the door or drawer is believed to be shut."""
    return world.articulations.get(container, 0.0) <= openness_of(articulation_called(world, container)).shut


def containers_before(furniture: MapFurniture, surface: MapSurface) -> Iterator[str]:
    """Yield the doors and drawers, ``furniture/name``, that must be open to reach objects on a surface."""
    for door in furniture.articulations:
        before = surface.drawer == door.name
        if before or (surface.drawer is None and furniture.is_inside(surface) and _covers(door, surface)):
            yield f"{furniture.name}/{door.name}"


def _covers(door: MapArticulation, surface: MapSurface) -> bool:
    """Return whether the front board of the closed door covers the surface."""
    front = door.shapes[0]
    if not isinstance(front.shape, Box):
        return False
    _, across, up = surface.pose.position - front.pose.position
    _, width, height = front.shape.size
    return abs(float(up)) < height / 2 and abs(float(across)) < (width + surface.size[1]) / 2
