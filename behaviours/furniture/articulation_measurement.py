"""The opening of a door or drawer, measured by a handle detected on it, by the plane of its board, or by the
rays of a depth image that end on its board or pass through it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.furniture.articulation import FurnitureArticulation
from behaviours.furniture.opening import Opening
from bestman_bt.messages import Box, Handle, PlacedShape, Pose, Pose2D, Shape, distance_to_shape, wrap_angle
from bestman_bt.messages.shapes import bounding_corners
from bestman_bt.world_model.openness import articulation_obstacles, handle_shape
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture
from bestman_bt.world_model.world_model import Obstacle, WorldModel

if TYPE_CHECKING:
    from bestman_bt.perception.segmentation.base import SupportPlane
    from bestman_bt.perception.view import View


# Where a piece of furniture really stands: measured by the front panel of a closed door or drawer.
# The map is off by centimetres and degrees. A front whose borders were seen is off by millimetres, and the map knows
# where on the piece that front is. A single front that stands out may be open, or the map may be wrong: fronts in one
# plane, as on the map, are shut, and give the place of the piece even if the map's error is much larger.


SAME_SIZE = 0.05
"""Metres by which a seen panel may differ from the map's front board."""
SAME_HEIGHT = 0.05
SLACK = 0.01
"""Tolerance of a front beyond the map's error, metres: noise, and a door that is not quite shut."""
POSITION_ERROR = 0.008
HEADING_ERROR = math.radians(0.4)
"""Errors of a piece of furniture after one of its fronts was measured, metres and radians."""
SAME_PLACE = 0.015
"""Largest difference, metres, between the poses of a piece that two shut fronts imply."""
MISPLACED = 0.16
"""Maximum correction of a mapped furniture pose when two of its fronts were measured, metres per axis."""


def believe_place(world: WorldModel, furniture: str, handle: Handle) -> None:
    """Correct the mapped pose of a piece by a handle's panel, if that is one of its closed fronts; once per piece."""
    piece = world.map.furniture[furniture]
    if piece.position_error <= POSITION_ERROR:
        return
    closed = (door for door in piece.articulations if world.articulations.get(f"{furniture}/{door.name}", 0.0) == 0.0)
    for door in closed:
        pose = _measured(piece, door, handle)
        if pose is not None:
            placed = replace(piece, pose=pose, position_error=POSITION_ERROR, heading_error=HEADING_ERROR)
            world.map = world.map.with_furniture(placed)
            return


def believe_shut_fronts(
    world: WorldModel, furniture: str, handles: Iterable[Handle], explained_too: bool = False
) -> None:
    """Correct the mapped pose of a piece if two fronts in one plane show an error beyond the map's bounds.

    ``explained_too``: also correct smaller errors, and use two fronts in different planes: the rear one counts as shut
    if the map's error explains the difference.
    """
    piece = world.map.furniture[furniture]
    if piece.position_error <= POSITION_ERROR:
        return
    seen = list(handles)
    poses = [
        [pose for handle in seen if (pose := _closed_pose(piece, door, handle)) is not None]
        for door in piece.articulations
    ]
    agreed = [
        one
        for index, places in enumerate(poses)
        for one in places
        if any(_same(one, other) for others in poses[index + 1 :] for other in others)
    ]
    candidates = agreed
    if explained_too and sum(bool(places) for places in poses) > 1:
        candidates = [one for places in poses for one in places]
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


def _measured(piece: MapFurniture, door: MapArticulation, handle: Handle) -> Pose2D | None:
    """Return the pose of the furniture if the handle is on this closed articulation, or None if the handle is
    elsewhere.
    """
    pose = _closed_pose(piece, door, handle)
    return pose if pose is not None and _explained(piece, pose) else None


def _closed_pose(piece: MapFurniture, door: MapArticulation, handle: Handle) -> Pose2D | None:
    """Return the pose the furniture would have if the handle were on this closed articulation, or None if the panel is
    not its front.
    """
    front = door.shapes[0]
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
    """Return whether the map's error explains that the piece stands at ``pose``."""
    near = np.abs(_off(piece, pose)).max() <= math.sqrt(2.0) * piece.position_error + SLACK
    return bool(near) and _turned(piece, pose) <= piece.heading_error + HEADING_ERROR


def _off(piece: MapFurniture, pose: Pose2D) -> NDArray[np.float64]:
    """Return the offset (2,), metres, from the furniture's mapped pose, in its frame: x backwards."""
    off: NDArray[np.float64] = piece.pose.inverse().apply(np.array([pose.xy]))[0]
    return off


def _turned(piece: MapFurniture, pose: Pose2D) -> float:
    return abs(wrap_angle(pose.theta - piece.pose.theta))


def _same(one: Pose2D, other: Pose2D) -> bool:
    return one.distance_to(other) < SAME_PLACE and abs(wrap_angle(one.theta - other.theta)) < 2.0 * HEADING_ERROR


def articulation_from_motion(
    opening: Opening, before: NDArray[np.float64], after: NDArray[np.float64], angle: float, stamp: float
) -> Obstacle:
    """Return the door with its handle, in the map frame, after the held point moved from ``before`` to ``after``, (3,)
    each.

    ``angle``: radians by which the door has turned. The detected handle gives the place of the front; the extent of the
    front to both sides comes from the map, with its error.
    """
    door, handle = opening.door, opening.handle
    front, believed = door.articulation.shapes[0], door.front(opening.start)
    assert isinstance(front.shape, Box)
    facing = math.atan2(-float(handle.outward[1]), -float(handle.outward[0]))
    outward = np.array([-math.cos(facing), -math.sin(facing), 0.0])
    face = believed.position + front.shape.size[0] / 2 * outward
    seen_face = handle.pose.position - handle.standoff * handle.outward
    seen = Pose.from_xyz_rpy(believed.position + float((seen_face - face) @ outward) * outward, (0.0, 0.0, facing))
    motion = Pose(after) @ _turn(handle.hinge_direction, angle) @ Pose(-before)
    moved = motion @ seen @ front.pose.inverse()
    boards = [
        PlacedShape(_larger(placed.shape, (0.0, door.furniture.position_error, 0.0)), moved @ placed.pose)
        for placed in door.articulation.shapes
    ]
    bar = handle_shape(handle)
    return Obstacle(door.name, (*boards, PlacedShape(bar.shape, motion @ bar.pose)), stamp)


def grown(door: Obstacle, by: float) -> Obstacle:
    """Return the door with boxes enlarged by ``by`` metres on each side."""
    sides = (by, by, by)
    return replace(door, shapes=tuple(replace(placed, shape=_larger(placed.shape, sides)) for placed in door.shapes))


def _larger(shape: Shape, by: tuple[float, float, float]) -> Shape:
    """Return a box enlarged ``by`` these metres on each side; other shapes as they are."""
    if not isinstance(shape, Box):
        return shape
    x, y, z = (size + 2.0 * more for size, more in zip(shape.size, by, strict=True))
    return Box((x, y, z))


def _turn(axis: NDArray[np.float64] | None, angle: float) -> Pose:
    if axis is None or angle == 0.0:
        return Pose()
    return Pose(np.zeros(3), np.append(math.sin(angle / 2) * axis, math.cos(angle / 2)))


ACROSS = 0.07
"""Metres by which a handle may be beside its front, in addition to the map's error."""
FACING = math.cos(math.radians(12.0))
"""Cosine of the maximum yaw error of a drawer's front."""
LEVER = 0.3
"""Smallest distance of a handle from the hinge, as a fraction of the door's width: nearer, a gap looks like a recessed
edge.
"""
SHUT = {"prismatic": 0.02, "revolute": math.radians(2.5)}
"""Openings below this value, in addition to the map's error, count as shut."""
ON_BOARD = 0.9
"""Fraction of a seen plane that has to lie on a board."""
BOARD_SEEN = 0.25
"""Fractions of a board's width and height that have to be seen."""
FILLED = 0.1
"""Fraction of the seen points that have to be in the middle quarter of the seen area; a frame has none there."""
SEEN_THROUGH = 0.15
"""Smallest fraction of the rays reaching a board's believed place that have to pass through it to reject that place."""
OPENINGS, RAYS = 61, 8000
"""Numbers of compared openings, and of rays per view."""
SUPPORT = 0.01
"""Smallest fraction of rays that end on a board; low, because few end on a distant edge."""
EXPLAINED = 0.6
"""Smallest fraction of the points in the door's swept space that lie on its board at the estimated opening."""


def opening_seen(door: FurnitureArticulation, handle: Handle) -> float | None:
    """Return the opening of ``door`` if ``handle`` (map frame) is on it, radians or metres, or None if it cannot be.

    A door is measured by the direction of its handle, a drawer by its distance; the map's error is tolerated.
    """
    piece, front = door.furniture, door.articulation.shapes[0]
    if not isinstance(front.shape, Box):
        return None
    thickness, width, height = front.shape.size
    slack = ACROSS + _place_error(piece)
    on_front = handle.pose.position - handle.standoff * handle.outward
    position = _position(door, on_front, handle.outward)
    if position is None:
        return None
    if door.articulation.kind == "revolute" and door.lever(handle.pose.position) < LEVER * width:
        return None
    x, y, z = door.front(position).inverse().apply(handle.pose.position[None])[0]
    before = abs(x + thickness / 2 + handle.standoff) < slack
    if not (before and abs(y) < width / 2 + slack and abs(z) < height / 2 + ACROSS / 2):
        return None
    return _rounded(door, position)


def opening_by_board(door: FurnitureArticulation, plane: SupportPlane) -> float | None:
    """Return the opening of ``door``, radians or metres, if ``plane`` (map frame) is a side of its board, or None.

    At a flat viewing angle, the board of a door may be recognised although its handle is not.
    """
    front = door.articulation.shapes[0]
    if not isinstance(front.shape, Box):
        return None
    size, piece = np.array(front.shape.size), door.furniture
    beside = ACROSS + _place_error(piece)
    # Little deeper lies the frame that a shut door covers.
    deep = SLACK + _place_error(piece) + piece.heading_error * size[1]
    for side in (-1.0, 1.0):  # the front faces -x
        outward = -side * plane.normal
        on_front = plane.frame_from_plane.position + (side + 1.0) / 2 * size[0] * outward
        position = _position(door, on_front, outward)
        if position is None:
            continue
        points = door.front(position).inverse().apply(plane.inliers)
        inside = np.abs(points - (side * size[0] / 2, 0.0, 0.0)) < np.array([deep, *(size[1:] / 2 + beside)])
        extent = np.ptp(points[:, 1:], axis=0)
        middle = np.abs(points[:, 1:] - points[:, 1:].min(axis=0) - extent / 2) < extent / 4
        seen = (extent > BOARD_SEEN * size[1:]).all() and middle.all(axis=1).mean() > FILLED
        if seen and inside.all(axis=1).mean() > ON_BOARD:
            return _rounded(door, position)
    return None


def bodies_around(world: WorldModel, door: FurnitureArticulation) -> tuple[PlacedShape, ...]:
    """Return the walls, the other furniture as solid boxes, and the other open doors and drawers, in the map frame.

    They are enlarged sideways by the map's error; heights are exact.
    """
    furniture = world.map.furniture
    solids = [
        Obstacle(name, (PlacedShape(Box((*piece.footprint, piece.height)), piece.pose.to_pose(piece.height / 2)),), 0.0)
        for name, piece in furniture.items()
        if name != door.furniture.name
    ]
    doors = [other for other in articulation_obstacles(world) if other.name != door.name]
    bodies = [PlacedShape(box, pose) for box, pose in world.map.wall_boxes()]
    for body in (*solids, *doors):
        error = _place_error(furniture[body.name.partition("/")[0]])
        bodies += [replace(placed, shape=_larger(placed.shape, (error, error, 0.0))) for placed in body.shapes]
    return tuple(bodies)


def opening_by_rays(
    door: FurnitureArticulation, believed: float, view: View, known: Sequence[PlacedShape]
) -> float | None:
    """Return the opening of ``door``, radians or metres, that fits a depth image best, or None if the image does not
    contradict the believed opening or no opening fits.

    Measured points on the board of an opening count for it, rays that pass through that board against it. This also
    works if only the edge of a door is visible, from far away or at a flat angle. The result is off by up to the map's
    error, which suffices to choose a view of the front. ``view``: in the map frame. ``known``: other bodies, in the map
    frame; points on them are ignored.
    """
    front, piece = door.articulation.shapes[0], door.furniture
    if not isinstance(front.shape, Box):
        return None
    thickness, *size = front.shape.size
    beside = _place_error(piece)
    deep = thickness / 2 + SLACK + beside
    openings = np.array([believed, *np.linspace(0.0, door.articulation.upper, OPENINGS)])
    boards = [door.front(opening) for opening in openings]
    corners = np.concatenate([board.apply(bounding_corners(front.shape)) for board in boards])
    points = view.cloud(corners).points
    points = points[:: 1 + len(points) // RAYS]
    unknown = np.ones(len(points), dtype=bool)
    for body in known:
        unknown &= distance_to_shape(points, body) > thickness / 2 + SLACK
    on = np.zeros((len(openings), len(points)), dtype=bool)
    through, score = np.zeros(len(openings)), np.zeros(len(openings))
    for index, board in enumerate(boards):
        local, eye = board.inverse().apply(points), board.inverse().apply(view.viewpoint[None])[0]
        on[index] = unknown & (np.abs(local) < (deep, *(np.array(size) / 2 + beside))).all(axis=1)
        through[index] = _passing(local, eye, deep, np.array(size) / 2 - deep).sum()
        score[index] = (1.0 - (local[on[index], 0] / deep) ** 2).sum() - through[index]
    best = 1 + int(np.argmax(score[1:]))
    if through[0] < SEEN_THROUGH * (through[0] + on[0].sum()) or score[best] <= SUPPORT * len(points):
        return None
    before = door.front(0.0).inverse().apply(points)[:, 0] < -deep
    moving = on.any(axis=0) & before
    if (on[best] & moving).sum() < EXPLAINED * moving.sum():
        return None
    return _rounded(door, float(openings[best]))


def _passing(
    points: NDArray[np.float64], eye: NDArray[np.float64], deep: float, half: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which rays from ``eye`` (3,) to ``points`` (N, 3), in the frame of a board, pass through it.

    ``deep``, ``half``: half the sizes, along x and (2,) along y and z, metres, of a box that a ray enters and leaves
    through its sides in x.
    """
    side = np.sign(eye[0])
    passing: NDArray[np.bool_] = (side * eye[0] > deep) & (side * points[:, 0] < -deep)
    way = points[passing] - eye
    for depth in (deep, -deep):
        crossing = eye[1:] + ((depth - eye[0]) / way[:, 0])[:, None] * way[:, 1:]
        inside = (np.abs(crossing) < half).all(axis=1)
        passing[passing], way = inside, way[inside]
    return passing


def _place_error(piece: MapFurniture) -> float:
    """Return the largest distance of a piece from its place on the map, metres: both axes may be off."""
    return 1.5 * piece.position_error


def _error(door: FurnitureArticulation) -> float:
    """Return the largest error of the map about the articulation's opening, radians or metres."""
    piece = door.furniture
    return piece.heading_error if door.articulation.kind == "revolute" else _place_error(piece)


def _position(door: FurnitureArticulation, on_front: NDArray[np.float64], outward: NDArray[np.float64]) -> float | None:
    """Return how far ``door`` is open if its front faces ``outward`` and goes through ``on_front``, (3,) each, map
    frame.

    None beyond where it can be.
    """
    _, axis = door.axis()
    closed = door.front(0.0)
    facing = -closed.rotation[:, 0]
    if door.articulation.kind == "prismatic":
        if float(outward @ facing) < FACING:
            return None
        front = door.articulation.shapes[0].shape
        assert isinstance(front, Box)
        face = closed.apply(np.array([[-front.size[0] / 2, 0.0, 0.0]]))[0]
        position = float((on_front - face) @ axis)
    else:
        position = math.atan2(float(np.cross(facing, outward) @ axis), float(facing @ outward))
    error = _error(door)
    return position if -error - SHUT[door.articulation.kind] <= position <= door.articulation.upper + error else None


def _rounded(door: FurnitureArticulation, position: float) -> float:
    """Return the opening, clipped to the articulation's range; 0 if it counts as shut."""
    return 0.0 if position < _error(door) + SHUT[door.articulation.kind] else min(position, door.articulation.upper)


def opening_since(door: FurnitureArticulation, believed: float, known: Handle, seen: Handle) -> float | None:
    """Return the opening of ``door`` by the motion of its handle since it was ``known`` at opening ``believed``.

    Unlike ``opening_seen``, it does not depend on the mapped pose of the piece. Handles are in the map frame; radians
    or metres, or None if ``seen`` is not that handle.
    """
    frame, (_, axis) = door.furniture.pose.to_pose(), door.axis()
    if door.articulation.kind == "prismatic":
        further = float((seen.pose.position - known.pose.position) @ axis)
    else:
        further = math.atan2(float(np.cross(known.outward, seen.outward) @ axis), float(known.outward @ seen.outward))
    position = believed + further
    moved = frame @ door.articulation.moved(position) @ door.articulation.moved(believed).inverse() @ frame.inverse()
    apart = seen.pose.position - moved.apply(known.pose.position[None])[0]
    along = float(apart @ seen.axis)
    beside = float(np.linalg.norm(apart - along * seen.axis))
    if beside > ACROSS + _place_error(door.furniture) or abs(along) > max(ACROSS, (known.length + seen.length) / 2):
        return None
    return 0.0 if position < SHUT[door.articulation.kind] else min(position, door.articulation.upper)
