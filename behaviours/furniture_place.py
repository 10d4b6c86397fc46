"""Where a piece of furniture really stands: measured by the front panel of a closed door or drawer.

The map is off by centimetres and degrees. A front whose borders were seen is off by millimetres, and the map knows
where on the piece that front is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Handle, Pose2D, wrap_angle
from bestman_bt.world_model import MapFurniture, MapLeaf, WorldModel

SAME_SIZE = 0.05
"""Metres by which a seen panel may differ from the map's front board."""
SAME_HEIGHT = 0.05
SLACK = 0.01
"""Metres that a front may be beyond where the map's error allows it: noise, and a leaf that is not quite shut."""
POSITION_ERROR = 0.008
HEADING_ERROR = math.radians(0.4)
"""How well a piece is known once a front of it was measured, metres and radians."""


def believe_place(world: WorldModel, furniture: str, handle: Handle) -> None:
    """Correct where the map has a piece by a handle's panel, if that is one of its closed fronts; once per piece."""
    piece = world.map.furniture[furniture]
    if piece.position_error <= POSITION_ERROR:
        return
    closed = (leaf for leaf in piece.leaves if world.articulations.get(f"{furniture}/{leaf.name}", 0.0) == 0.0)
    for leaf in closed:
        pose = _measured(piece, leaf, handle)
        if pose is not None:
            placed = replace(piece, pose=pose, position_error=POSITION_ERROR, heading_error=HEADING_ERROR)
            world.map = world.map.with_furniture(placed)
            return


def _measured(piece: MapFurniture, leaf: MapLeaf, handle: Handle) -> Pose2D | None:
    """Where the piece stands if the handle is on this leaf and that is shut; None if it is not, as far as is known."""
    front = leaf.shapes[0]
    if handle.panel is None or handle.panel_size is None or not isinstance(front.shape, Box):
        return None
    size_off = np.abs(np.array(handle.panel_size) - front.shape.size[1:])
    if size_off.max() > SAME_SIZE or abs(handle.panel.position[2] - front.pose.position[2]) > SAME_HEIGHT:
        return None
    outward: NDArray[np.float64] = handle.outward
    theta = math.atan2(-float(outward[1]), -float(outward[0]))
    face = front.pose.position[:2] - np.array([front.shape.size[0] / 2, 0.0])
    x, y = handle.panel.position[:2] - Pose2D(theta=theta).apply(face[None])[0]
    off = np.abs(piece.pose.inverse().apply(np.array([[x, y]]))[0])
    turned = abs(wrap_angle(theta - piece.pose.theta))
    if off.max() > math.sqrt(2.0) * piece.position_error + SLACK or turned > piece.heading_error + HEADING_ERROR:
        return None
    return Pose2D(float(x), float(y), theta)
