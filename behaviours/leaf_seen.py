"""How far a door or drawer stands open, by a handle that was seen on it."""

from __future__ import annotations

import math

import numpy as np

from behaviours.leaf import Leaf
from bestman_bt.messages import Box, Handle

ACROSS = 0.07
"""Metres by which a handle may be beside its front, in addition to what the map may be off."""
FACING = math.cos(math.radians(12.0))
"""Cosine of what a drawer's front may be turned."""
LEVER = 0.3
"""Share of a door's width that a handle is from the hinge at least: nearer, a gap looks like a recessed edge."""
SHUT = {"prismatic": 0.02, "revolute": math.radians(2.5)}
"""What seems open by less than that, in addition to what the map may be off, counts as shut."""


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
    _, axis = leaf.axis()
    closed = -leaf.front(0.0).rotation[:, 0]
    if leaf.leaf.kind == "prismatic":
        if float(handle.outward @ closed) < FACING:
            return None
        on_front = handle.pose.position - handle.standoff * handle.outward
        face = leaf.front(0.0).apply(np.array([[-thickness / 2, 0.0, 0.0]]))[0]
        position, error = float((on_front - face) @ axis), 1.5 * piece.position_error
    else:
        position = math.atan2(float(np.cross(closed, handle.outward) @ axis), float(closed @ handle.outward))
        error = piece.heading_error
    if not -error - SHUT[leaf.leaf.kind] <= position <= leaf.leaf.upper + error:
        return None
    if leaf.leaf.kind == "revolute" and leaf.lever(handle.pose.position) < LEVER * width:
        return None
    x, y, z = leaf.front(position).inverse().apply(handle.pose.position[None])[0]
    before = abs(x + thickness / 2 + handle.standoff) < slack
    if not (before and abs(y) < width / 2 + slack and abs(z) < height / 2 + ACROSS / 2):
        return None
    return 0.0 if position < error + SHUT[leaf.leaf.kind] else min(position, leaf.leaf.upper)


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
