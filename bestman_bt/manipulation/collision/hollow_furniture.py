"""Furniture that an arm reaches into: its boards, and its doors and drawers where they are believed to be."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from bestman_bt.manipulation.collision.planning_scene import SceneObstacle
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.world_model import MapFurniture, WorldModel, handle_shape, leaf_shapes

SAME_HEIGHT = 0.006
"""Metres between a surface and the upper side of the board that it belongs to, at most."""

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])  # of a box's corners


def hollow_furniture(
    world_model: WorldModel,
    base_from_map: Pose,
    names: Iterable[str],
    *,
    offset: float,
    turn: float,
    reach: float,
) -> list[SceneObstacle]:
    """Obstacles ``furniture`` (its boards) and ``furniture/leaf`` (with its handle where it stands open), base frame.

    ``offset``, ``turn``: how far any piece may be from where the map has it at most, metres and radians; boards are
    thickened sideways by that, or by the errors of a piece that is known better; heights are exact. ``reach``: metres
    from the base beyond which pieces are left out. A board whose surface was measured is left out: the measured one is
    an obstacle of its own.
    """
    obstacles = []
    for name in names:
        piece = world_model.map.furniture[name]
        base_from_piece, piece_from_map = base_from_map @ piece.pose.to_pose(), piece.pose.to_pose().inverse()
        if float(np.linalg.norm(base_from_piece.position[:2])) - math.hypot(*piece.footprint) / 2 >= reach:
            continue
        errors = min(offset, piece.position_error), min(turn, piece.heading_error)
        bodies = {name: [_grown(shape, piece, errors) for shape in piece.shapes]}
        for leaf in piece.leaves:
            boards = [_grown(shape, piece, errors) for shape in leaf_shapes(world_model, piece, leaf)]
            if world_model.articulations.get(f"{name}/{leaf.name}", 0.0) > 0.0:
                seen = [handle_shape(belief.handle) for belief in world_model.handles_of(piece, leaf)]
                boards += [PlacedShape(bar.shape, piece_from_map @ bar.pose) for bar in seen]
            bodies[f"{name}/{leaf.name}"] = boards
        measured = _measured_surfaces(world_model, piece)
        for body, shapes in bodies.items():
            if body not in world_model.obstacles:
                unseen = [shape for shape in shapes if not any(_carries(shape, pose) for pose in measured)]
                in_base = tuple(PlacedShape(shape.shape, base_from_piece @ shape.pose) for shape in unseen)
                obstacles.append(SceneObstacle(body, in_base))
    return obstacles


def _measured_surfaces(world_model: WorldModel, piece: MapFurniture) -> list[Pose]:
    """Poses in the furniture frame of the surfaces within a piece that were measured."""
    inner = (surface.name for surface in piece.surfaces if piece.is_inside(surface))
    names = [f"{piece.name}/{name}" for name in inner if f"{piece.name}/{name}/surface" in world_model.obstacles]
    return [world_model.surface(name)[1].pose for name in names]


def _carries(board: PlacedShape, surface: Pose) -> bool:
    """Whether a surface is the upper side of a level board."""
    if not isinstance(board.shape, Box):
        return False
    x, y, z = (float(value) for value in np.abs(board.pose.inverse().apply(surface.position[None])[0]))
    half_x, half_y, half_z = (extent / 2 for extent in board.shape.size)
    inside = x < half_x + SAME_HEIGHT and y < half_y + SAME_HEIGHT and z < half_z + SAME_HEIGHT
    top = float(board.pose.position[2] + np.abs(board.pose.rotation[2]) @ np.array(board.shape.size) / 2)
    return inside and abs(top - float(surface.position[2])) < SAME_HEIGHT


def _grown(placed: PlacedShape, piece: MapFurniture, errors: tuple[float, float]) -> PlacedShape:
    """A board that covers where it may be: moved by ``offset`` along x and y of the map, turned with its piece."""
    offset, turn = errors
    if not isinstance(placed.shape, Box):
        return placed
    corners = placed.pose.apply(_SIGNS * np.array(placed.shape.size) / 2)[:, :2]
    axes = placed.pose.rotation[:2]  # (2, 3): how far each of the board's axes lies in the plane, and whereto
    cosine, sine = math.cos(piece.pose.theta), math.sin(piece.pose.theta)
    moved = offset * np.abs(np.array([[cosine, -sine], [sine, cosine]]) @ axes).sum(axis=0)
    sideways = np.abs(np.outer(corners[:, 0], axes[1]) - np.outer(corners[:, 1], axes[0])).max(axis=0)
    inwards = float(np.linalg.norm(corners, axis=1).max()) * np.linalg.norm(axes, axis=0)
    shift = moved + math.sin(turn) * sideways + (1.0 - math.cos(turn)) * inwards
    x, y, z = (float(size + 2 * grow) for size, grow in zip(placed.shape.size, shift, strict=True))
    return PlacedShape(Box((x, y, z)), placed.pose)
