"""How far a door or drawer stands open, by a handle that was seen on it or by its board."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.leaf import Leaf
from bestman_bt.messages import Box, Handle

if TYPE_CHECKING:
    from bestman_bt.perception.segmentation import SupportPlane

ACROSS = 0.07
"""Metres by which a handle may be beside its front, in addition to what the map may be off."""
FACING = math.cos(math.radians(12.0))
"""Cosine of what a drawer's front may be turned."""
LEVER = 0.3
"""Share of a door's width that a handle is from the hinge at least: nearer, a gap looks like a recessed edge."""
SHUT = {"prismatic": 0.02, "revolute": math.radians(2.5)}
"""What seems open by less than that, in addition to what the map may be off, counts as shut."""
ON_BOARD = 0.9
"""Share of a seen plane that has to lie on a board."""
BOARD_SEEN = 0.25
"""Shares of a board's width and height that have to be seen."""


def opening_seen(leaf: Leaf, handle: Handle) -> float | None:
    """How far ``leaf`` is open if ``handle`` (map frame) is on it, radians or metres; None if it cannot be on it.

    A door tells by the direction that its handle faces, a drawer by how far it stands out; the map's error is allowed
    for.
    """
    piece, front = leaf.furniture, leaf.leaf.shapes[0]
    if not isinstance(front.shape, Box):
        return None
    thickness, width, height = front.shape.size
    slack = ACROSS + 1.5 * piece.position_error
    on_front = handle.pose.position - handle.standoff * handle.outward
    position = _position(leaf, on_front, handle.outward)
    if position is None:
        return None
    if leaf.leaf.kind == "revolute" and leaf.lever(handle.pose.position) < LEVER * width:
        return None
    x, y, z = leaf.front(position).inverse().apply(handle.pose.position[None])[0]
    before = abs(x + thickness / 2 + handle.standoff) < slack
    if not (before and abs(y) < width / 2 + slack and abs(z) < height / 2 + ACROSS / 2):
        return None
    return _rounded(leaf, position)


def opening_by_board(leaf: Leaf, plane: SupportPlane) -> float | None:
    """How far ``leaf`` is open if ``plane`` (map frame) is the front or the back of its board, radians or metres.

    None if it cannot be that. A door that is seen at a flat angle shows its board where its handle is not recognised.
    """
    front = leaf.leaf.shapes[0]
    if not isinstance(front.shape, Box):
        return None
    size = np.array(front.shape.size)
    slack = ACROSS + 1.5 * leaf.furniture.position_error
    for side in (-1.0, 1.0):  # the front faces -x
        outward = -side * plane.normal
        on_front = plane.frame_from_plane.position + (side + 1.0) / 2 * size[0] * outward
        position = _position(leaf, on_front, outward)
        if position is None:
            continue
        points = leaf.front(position).inverse().apply(plane.inliers)
        inside = np.abs(points - (side * size[0] / 2, 0.0, 0.0)) < np.array([0.0, *size[1:] / 2]) + slack
        seen = np.ptp(points[:, 1:], axis=0) > BOARD_SEEN * size[1:]
        if inside.all(axis=1).mean() > ON_BOARD and seen.all():
            return _rounded(leaf, position)
    return None


def _error(leaf: Leaf) -> float:
    """By how much the map may be wrong about how far a leaf is open, radians or metres."""
    piece = leaf.furniture
    return piece.heading_error if leaf.leaf.kind == "revolute" else 1.5 * piece.position_error


def _position(leaf: Leaf, on_front: NDArray[np.float64], outward: NDArray[np.float64]) -> float | None:
    """How far ``leaf`` is open if its front faces ``outward`` and goes through ``on_front``, (3,) each, map frame.

    None beyond where it can be.
    """
    _, axis = leaf.axis()
    closed = leaf.front(0.0)
    facing = -closed.rotation[:, 0]
    if leaf.leaf.kind == "prismatic":
        if float(outward @ facing) < FACING:
            return None
        front = leaf.leaf.shapes[0].shape
        assert isinstance(front, Box)
        face = closed.apply(np.array([[-front.size[0] / 2, 0.0, 0.0]]))[0]
        position = float((on_front - face) @ axis)
    else:
        position = math.atan2(float(np.cross(facing, outward) @ axis), float(facing @ outward))
    error = _error(leaf)
    return position if -error - SHUT[leaf.leaf.kind] <= position <= leaf.leaf.upper + error else None


def _rounded(leaf: Leaf, position: float) -> float:
    """0 where it counts as shut; no farther than it opens."""
    return 0.0 if position < _error(leaf) + SHUT[leaf.leaf.kind] else min(position, leaf.leaf.upper)


def opening_since(leaf: Leaf, believed: float, known: Handle, seen: Handle) -> float | None:
    """How far ``leaf`` is open by how its handle has moved since it was ``known`` and the leaf open by ``believed``.

    Other than what ``opening_seen`` tells, that does not depend on where exactly the map has the piece. Handles are in
    the map frame; radians or metres; None if ``seen`` is not that handle.
    """
    frame, (_, axis) = leaf.furniture.pose.to_pose(), leaf.axis()
    if leaf.leaf.kind == "prismatic":
        further = float((seen.pose.position - known.pose.position) @ axis)
    else:
        further = math.atan2(float(np.cross(known.outward, seen.outward) @ axis), float(known.outward @ seen.outward))
    position = believed + further
    moved = frame @ leaf.leaf.moved(position) @ leaf.leaf.moved(believed).inverse() @ frame.inverse()
    apart = seen.pose.position - moved.apply(known.pose.position[None])[0]
    along = float(apart @ seen.axis)
    beside = float(np.linalg.norm(apart - along * seen.axis))
    if beside > ACROSS + 1.5 * leaf.furniture.position_error or abs(along) > max(
        ACROSS, (known.length + seen.length) / 2
    ):
        return None
    return 0.0 if position < SHUT[leaf.leaf.kind] else min(position, leaf.leaf.upper)
