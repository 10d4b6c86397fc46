"""Where a door or drawer is by feel: the hand that has moved it knows that better than the map does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from behaviours.opening import Opening
from bestman_bt.messages import Box, PlacedShape, Pose, Shape
from bestman_bt.world_model import Obstacle, handle_shape


def felt_leaf(
    opening: Opening, before: NDArray[np.float64], after: NDArray[np.float64], angle: float, stamp: float
) -> Obstacle:
    """The leaf with its handle, in the map frame, after the held place went from ``before`` to ``after``, (3,) each.

    ``angle``: radians by which the door has turned. The handle as it was seen tells where the front was; how the front
    lies to both sides of the handle is the map's, with the map's error.
    """
    leaf, handle = opening.leaf, opening.handle
    front, believed = leaf.leaf.shapes[0], leaf.front(opening.start)
    assert isinstance(front.shape, Box)
    facing = math.atan2(-float(handle.outward[1]), -float(handle.outward[0]))
    outward = np.array([-math.cos(facing), -math.sin(facing), 0.0])
    face = believed.position + front.shape.size[0] / 2 * outward
    seen_face = handle.pose.position - handle.standoff * handle.outward
    seen = Pose.from_xyz_rpy(believed.position + float((seen_face - face) @ outward) * outward, (0.0, 0.0, facing))
    motion = Pose(after) @ _turn(handle.hinge_direction, angle) @ Pose(-before)
    moved = motion @ seen @ front.pose.inverse()
    boards = [
        PlacedShape(_wider(placed.shape, leaf.furniture.position_error), moved @ placed.pose)
        if isinstance(placed.shape, Box)
        else PlacedShape(placed.shape, moved @ placed.pose)
        for placed in leaf.leaf.shapes
    ]
    bar = handle_shape(handle)
    return Obstacle(leaf.articulation, (*boards, PlacedShape(bar.shape, motion @ bar.pose)), stamp)


def grown(leaf: Obstacle, by: float) -> Obstacle:
    """The leaf with boxes that are larger by so many metres on each side."""
    return replace(leaf, shapes=tuple(replace(placed, shape=_larger(placed.shape, by)) for placed in leaf.shapes))


def _larger(shape: Shape, by: float) -> Shape:
    if not isinstance(shape, Box):
        return shape
    x, y, z = (extent + 2.0 * by for extent in shape.size)
    return Box((x, y, z))


def _wider(box: Box, error: float) -> Box:
    x, y, z = box.size
    return Box((x, y + 2.0 * error, z))


def _turn(axis: NDArray[np.float64] | None, angle: float) -> Pose:
    if axis is None or angle == 0.0:
        return Pose()
    return Pose(np.zeros(3), np.append(math.sin(angle / 2) * axis, math.cos(angle / 2)))
