"""The pose of an object on a surface, and its clearance there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.scene.plane_geometry import Points, distance_to_polygon, rectangle, wall_rectangle
from bestman_bt.scene.scene import PlacedFurniture, PlacedObject, Surface, Wall

if TYPE_CHECKING:
    from bestman_bt.scene.scene_config import SceneConfig


_OVERHEAD = 1.8
"""Height above the floor, metres, from which on a board, such as the lintel of a door, obstructs no pedestrian."""


def standing_outlines(walls: Iterable[Wall], furniture: Iterable[PlacedFurniture]) -> list[Points]:
    """Return convex counter-clockwise polygons of walls, footprints, frames of room doors, and open doors and
    drawers."""
    pieces = list(furniture)
    outlines = [wall_rectangle(wall) for wall in walls]
    for piece in pieces:
        outlines += body_outlines(piece)
    return [*outlines, *(outline for piece in pieces for outline in articulation_outlines(piece))]


def body_outlines(piece: PlacedFurniture) -> list[Points]:
    """Return the footprint of a piece, or the posts of a door between rooms."""
    if piece.model.is_passage:
        return list(_outlines(piece.model.parts, piece.pose))
    return [rectangle(piece.actual, piece.model.footprint)]


def articulation_outlines(piece: PlacedFurniture) -> Iterator[Points]:
    """Yield the outlines of open doors and drawers; of room doors also if closed."""
    for door in piece.model.articulations:
        position = piece.open.get(door.name, 0.0)
        if position > 0.0 or piece.model.is_passage:
            yield from _outlines(door.parts, piece.pose @ door.moved(position))


def _outlines(parts: Iterable[PlacedShape], map_from_parts: Pose) -> Iterator[Points]:
    for part in parts:
        if isinstance(part.shape, Box):
            box = np.array(list(product((-0.5, 0.5), repeat=3))) * part.shape.size
            corners = (map_from_parts @ part.pose).apply(box)
            if corners[:, 2].min() < _OVERHEAD:
                yield corners[ConvexHull(corners[:, :2]).vertices, :2]


def standing_furniture(
    scene: SceneConfig, shares: Callable[[str], Sequence[float]] = lambda piece: (0.0, 0.0, 0.0)
) -> tuple[PlacedFurniture, ...]:
    """Return the furniture in the order of the file, displaced from its nominal pose.

    ``shares``: by a piece's name the fractions, each from -1 to 1, of its ``offset`` along x and y and of its ``turn``.
    """
    pieces: list[PlacedFurniture] = []
    for name, placement in scene.file.furniture.items():
        nominal = Pose2D(*placement.at)
        dx, dy, turn = shares(name)
        actual = Pose2D(
            nominal.x + placement.offset * float(dx),
            nominal.y + placement.offset * float(dy),
            nominal.theta + placement.turn * float(turn),
        )
        elevation, on = 0.0, None
        if placement.on is not None:
            below, surface = surface_of(scene, placement.on, pieces)
            in_furniture = surface.pose.to_pose2d()
            nominal, actual = below.nominal @ in_furniture @ nominal, below.actual @ in_furniture @ actual
            elevation, on = below.elevation + float(surface.pose.position[2]), below.name
        piece = PlacedFurniture(name, scene.furniture[name], nominal, actual, elevation, on, placement.open)
        pieces.append(replace(piece, mapped_open=placement.mapped_open))
    return tuple(pieces)


def surface_of(
    scene: SceneConfig, surface_name: str, furniture: Sequence[PlacedFurniture]
) -> tuple[PlacedFurniture, Surface]:
    """Return the piece that bears the surface called ``furniture`` or ``furniture/surface``, and that surface."""
    name, surface = scene.surface(surface_name)
    return next(piece for piece in furniture if piece.name == name), surface


def planar_radius(model: ObjectModel) -> float:
    """Return the radius of the circle around the object's frame that contains its collision shapes in top view,
    metres."""
    if model.symmetry_order == 0:
        return float(model.size[:2].max()) / 2
    return math.hypot(*model.size[:2]) / 2


def standing_on(map_from_surface: Pose, on_surface: Pose2D, model: ObjectModel) -> Pose:
    """Return the pose in the map frame of an object at ``on_surface``, in the surface's frame."""
    lower = float(model.bounds()[0, 2])
    return map_from_surface @ on_surface.to_pose(-lower)


def gap_to_objects(pose: Pose, model: ObjectModel, others: Iterable[PlacedObject]) -> float:
    """Return the smallest distance between the circles of one object and others at its height, metres; infinite without
    others."""
    here: NDArray[np.float64] = pose.position[:2]
    gaps = [
        float(np.linalg.norm(other.pose.position[:2] - here)) - planar_radius(model) - planar_radius(other.model)
        for other in others
        if abs(pose.position[2] - other.pose.position[2]) < (model.size[2] + other.model.size[2]) / 2
    ]
    return min(gaps, default=math.inf)


def gap_to_furniture(
    pose: Pose, model: ObjectModel, piece: PlacedFurniture, furniture: Iterable[PlacedFurniture]
) -> float:
    """Return the smallest distance from an object's circle to other furniture on ``piece``, metres; infinite without
    any.
    """
    distances = [
        distance_to_polygon(rectangle(other.actual, other.model.footprint), pose.position[:2])
        for other in furniture
        if other.on == piece.name
    ]
    return min(distances, default=math.inf) - planar_radius(model)
