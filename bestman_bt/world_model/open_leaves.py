"""Doors and drawers that stand open: where they and their handles are believed to be."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import Box, Handle, PlacedShape, Pose
from bestman_bt.world_model.semantic_map import MapFurniture, MapLeaf
from bestman_bt.world_model.world_model import Obstacle, WorldModel


def leaf_shapes(world_model: WorldModel, furniture: MapFurniture, leaf: MapLeaf) -> tuple[PlacedShape, ...]:
    """The boards of a door or drawer where it is believed to be, in the furniture frame."""
    opened = world_model.opening_of(furniture, leaf)
    return tuple(PlacedShape(shape.shape, opened @ shape.pose) for shape in leaf.shapes)


def open_leaves(world_model: WorldModel) -> tuple[Obstacle, ...]:
    """Doors and drawers before the furniture that stand open, with their handles, named ``furniture/leaf``.

    Of a door between rooms the leaf counts where it is believed to be: closed, it stands in the way, too.
    """
    obstacles = []
    for piece in world_model.map.furniture.values():
        for leaf in piece.leaves:
            name = f"{piece.name}/{leaf.name}"
            if piece.is_passage or world_model.articulations.get(name, 0.0) > 0.0:
                frame = piece.pose.to_pose()
                boards = [PlacedShape(s.shape, frame @ s.pose) for s in leaf_shapes(world_model, piece, leaf)]
                handles = [handle_shape(belief.handle) for belief in world_model.handles_of(piece, leaf)]
                obstacles.append(Obstacle(name, (*boards, *handles), 0.0))
    return tuple(obstacles)


def handle_shape(handle: Handle) -> PlacedShape:
    """A box from the front to beyond the handle, in the handle's frame of reference."""
    thickness = 2.0 * handle.radius
    depth = max(handle.standoff, 0.0) + handle.radius
    middle = Pose(np.array([0.0, 0.0, handle.radius - depth / 2]))
    return PlacedShape(Box((max(handle.length, thickness), thickness, depth)), handle.pose @ middle)
