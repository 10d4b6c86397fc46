"""Where a piece of furniture really stands: measured by the front panel of a closed door or drawer.

The map is off by centimetres and degrees. A front whose borders were seen is off by millimetres, and the map knows
where on the piece that front is. A single front that stands out may be open, or the map may be wrong: fronts in one
plane, as on the map, are shut, and tell where the piece stands even where the map is wrong by much more.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
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
SAME_PLACE = 0.015
"""Metres within which two shut fronts tell the same place of a piece."""
MISPLACED = 0.16
"""Metres, each axis, that a piece may stand from its place on the map where two of its fronts tell so."""


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


def believe_shut_fronts(
    world: WorldModel, furniture: str, handles: Iterable[Handle], explained_too: bool = False
) -> None:
    """Correct where the map has a piece that two fronts in one plane show to be farther off than the map may be.

    ``explained_too``: also by less than that, and where the two are in two planes: the one farther back is shut, which
    counts where the map's error explains it; by itself it shows no more.
    """
    piece = world.map.furniture[furniture]
    if piece.position_error <= POSITION_ERROR:
        return
    seen = list(handles)
    told = [[pose for handle in seen if (pose := _told(piece, leaf, handle)) is not None] for leaf in piece.leaves]
    agreed = [
        one
        for index, places in enumerate(told)
        for one in places
        if any(_same(one, other) for others in told[index + 1 :] for other in others)
    ]
    candidates = agreed
    if explained_too and sum(bool(places) for places in told) > 1:
        candidates = [one for places in told for one in places]
    if not candidates:
        return
    # Two that stand open as far as each other look like shut ones of a nearer piece: the farthest back counts.
    pose = max(candidates, key=lambda place: float(_off(piece, place)[0]))
    off = np.abs(_off(piece, pose)).max()
    if off > MISPLACED or _turned(piece, pose) > piece.heading_error + HEADING_ERROR:
        return
    if not (explained_too if _explained(piece, pose) else any(_same(pose, one) for one in agreed)):
        return
    placed = replace(piece, pose=pose, position_error=POSITION_ERROR, heading_error=HEADING_ERROR)
    world.map = world.map.with_furniture(placed)


def _measured(piece: MapFurniture, leaf: MapLeaf, handle: Handle) -> Pose2D | None:
    """Where the piece stands if the handle is on this leaf and that is shut; None if it is not, as far as is known."""
    pose = _told(piece, leaf, handle)
    return pose if pose is not None and _explained(piece, pose) else None


def _told(piece: MapFurniture, leaf: MapLeaf, handle: Handle) -> Pose2D | None:
    """Where the piece would stand if the handle were on this leaf and that shut; None if the panel is not its front."""
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
    return Pose2D(float(x), float(y), theta)


def _explained(piece: MapFurniture, pose: Pose2D) -> bool:
    """Whether the map's error explains that the piece stands at ``pose``."""
    near = np.abs(_off(piece, pose)).max() <= math.sqrt(2.0) * piece.position_error + SLACK
    return bool(near) and _turned(piece, pose) <= piece.heading_error + HEADING_ERROR


def _off(piece: MapFurniture, pose: Pose2D) -> NDArray[np.float64]:
    """Metres (2,) from the piece's place on the map, in its frame: x backwards."""
    off: NDArray[np.float64] = piece.pose.inverse().apply(np.array([pose.xy]))[0]
    return off


def _turned(piece: MapFurniture, pose: Pose2D) -> float:
    return abs(wrap_angle(pose.theta - piece.pose.theta))


def _same(one: Pose2D, other: Pose2D) -> bool:
    return one.distance_to(other) < SAME_PLACE and abs(wrap_angle(one.theta - other.theta)) < 2.0 * HEADING_ERROR
