"""Furniture that an arm reaches into: its boards, and its doors and drawers where they are believed to be."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from bestman_bt.manipulation.collision.planning_scene import SceneObstacle
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.world_model import MapFurniture, WorldModel


def hollow_furniture(
    world_model: WorldModel,
    base_from_map: Pose,
    names: Iterable[str],
    *,
    offset: float,
    turn: float,
    reach: float,
) -> list[SceneObstacle]:
    """Obstacles ``furniture`` (its boards) and ``furniture/leaf``, in the base frame.

    ``offset``, ``turn``: how far the piece may be from where the map has it, metres and radians: boards are thickened
    sideways by that; heights are exact. ``reach``: metres from the base beyond which pieces are left out.
    """
    obstacles = []
    for name in names:
        piece = world_model.map.furniture[name]
        base_from_piece = base_from_map @ piece.pose.to_pose()
        if float(np.linalg.norm(base_from_piece.position[:2])) - math.hypot(*piece.footprint) / 2 >= reach:
            continue
        bodies = {name: (piece.shapes, Pose())}
        for leaf in piece.leaves:
            moved = leaf.moved(world_model.articulations.get(f"{name}/{leaf.name}", 0.0))
            bodies[f"{name}/{leaf.name}"] = (leaf.shapes, moved)
        for body, (shapes, moved) in bodies.items():
            if body not in world_model.obstacles:
                placed = (PlacedShape(shape.shape, moved @ shape.pose) for shape in shapes)
                grown = (_grown(shape, piece, offset, turn) for shape in placed)
                in_base = tuple(PlacedShape(shape.shape, base_from_piece @ shape.pose) for shape in grown)
                obstacles.append(SceneObstacle(body, in_base))
    return obstacles


def _grown(placed: PlacedShape, piece: MapFurniture, offset: float, turn: float) -> PlacedShape:
    """A board that covers where it may be: moved by ``offset`` along x and y, turned about the middle of the piece."""
    if not isinstance(placed.shape, Box):
        return placed
    furthest = math.hypot(*piece.footprint) / 2
    sideways = offset + furthest * math.sin(turn)
    # of each axis of the board, how much of a horizontal shift can lie along it
    horizontal = np.hypot(placed.pose.rotation[0], placed.pose.rotation[1])
    x, y, z = (float(size + 2 * sideways * share) for size, share in zip(placed.shape.size, horizontal, strict=True))
    return PlacedShape(Box((x, y, z)), placed.pose)
