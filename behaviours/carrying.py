"""Carrying what no posture of the robot holds upright: beside the mast, over the base, out of the camera's view."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from behaviours.context import SkillContext
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose
from bestman_bt.world_model import HeldObject

if TYPE_CHECKING:
    from bestman_bt.manipulation.collision import CollisionWorld, SceneObstacle

BESIDE = (
    (0.0, 0.25, 1.45),
    (0.0, -0.2, 1.45),
    (0.1, 0.25, 1.45),
    (0.2, -0.2, 1.45),
    (-0.1, 0.2, 1.35),
    (-0.1, -0.25, 1.4),
    (0.1, 0.3, 1.25),
    (0.1, -0.3, 1.25),
)
"""Places, (x, y, z) metres in the base frame, for what is held."""
TURNS_BESIDE = tuple(math.radians(degrees) for degrees in (0, 45, -45, 90, -90, 135, -135, 180))
"""Turns of the hand from straight ahead there."""
SAME_PLACE = 0.05
"""Metres from such a place within which what is held counts as there."""
ENOUGH = 6
"""Postures among which the planner may choose."""
IN_VIEW = ((0.6, 0.0, 0.8), (0.75, 0.0, 0.8), (0.65, 0.25, 0.8), (0.65, -0.25, 0.8))
"""Points, (x, y, z) metres in the base frame, that the head camera should see: on a table before the robot."""
SIGHT = (0.05, 0.08, 0.1)
"""Metres: the radius that is kept free about a line of sight, and how much of it is not at the camera and the point."""
ROOM_TO_TURN = (-0.42, 0.45, 0.42)
"""Metres in the base frame: the arm stays before the first x, behind the second, and within this y on both sides."""


def postures_beside(
    skills: SkillContext,
    held: HeldObject,
    posture: NDArray[np.float64],
    world: CollisionWorld,
    sights: Sequence[NDArray[np.float64]] = (),
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Joint positions (n,) in which what is held stands upright beside the mast, whichever way the hand has taken it.

    First those that leave the head camera's view free and do not stand out over the base, then others; each nearest to
    the present ones first. Only the present ones, if they are such. They are sought near these and near ``posture``.
    ``world``: what they must be free in. ``sights``: points (3,), base frame, that the camera should see as well.
    """
    clear = _things_that_are_not_there(skills, (_lines(skills, [*IN_VIEW, *sights]), _fence()))
    now = skills.arm_positions()
    held_at = (skills.base_from_tool() @ held.tool_from_object).position
    is_beside = min(float(np.linalg.norm(held_at - place)) for place in BESIDE) < SAME_PLACE
    if is_beside and world.is_free(now) and clear.is_free(now):
        return [now], []
    ahead = held.tool_from_object.inverse().rotation[:, 2]
    yaw_ahead = -math.atan2(float(ahead[1]), float(ahead[0]))
    found: list[NDArray[np.float64]] = []
    others: list[NDArray[np.float64]] = []
    for place in BESIDE:
        for turn in TURNS_BESIDE:
            base_from_object = Pose.from_xyz_rpy(place, (0.0, 0.0, yaw_ahead + turn))
            base_from_tool = base_from_object @ held.tool_from_object.inverse()
            for reference in (now, posture):
                result = skills.kinematics.solve(
                    base_from_tool, reference, skills.rng, count=2, is_valid=world.is_free, attempts=4
                )
                for positions in result.solutions:
                    (found if clear.is_free(positions) else others).append(positions)
    return _nearest(found, now), _nearest(others, now)


def _nearest(postures: list[NDArray[np.float64]], now: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    return sorted(postures, key=lambda positions: float(np.abs(positions - now).max()))[:ENOUGH]


def out_of_sight(skills: SkillContext, point: NDArray[np.float64]) -> CollisionWorld:
    """In which the arm, with what it holds, is free where the head camera sees past it to a point (3,), base frame."""
    return _things_that_are_not_there(skills, (_lines(skills, [point]),))


def _things_that_are_not_there(skills: SkillContext, things: Sequence[SceneObstacle]) -> CollisionWorld:
    return skills.arm_world(replace(skills.planning_scene(), obstacles=tuple(things), voxels=()))


def _lines(skills: SkillContext, points: Sequence[ArrayLike]) -> SceneObstacle:
    from bestman_bt.manipulation.collision import SceneObstacle

    if not skills.has("camera"):
        return SceneObstacle("sight", ())
    eye = skills.camera.base_from_camera().position
    return SceneObstacle("sight", tuple(_line_of_sight(eye, np.asarray(point)) for point in points))


def _fence() -> SceneObstacle:
    """About the base."""
    from bestman_bt.manipulation.collision import SceneObstacle

    back, front, side = ROOM_TO_TURN
    boards = tuple(
        PlacedShape(Box(size), Pose(np.array(middle)))
        for size, middle in (
            ((0.2, 4.0, 3.0), (back - 0.1, 0.0, 1.5)),
            ((0.2, 4.0, 3.0), (front + 0.1, 0.0, 1.5)),
            ((4.0, 0.2, 3.0), (0.0, side + 0.1, 1.5)),
            ((4.0, 0.2, 3.0), (0.0, -side - 0.1, 1.5)),
        )
    )
    return SceneObstacle("fence", boards)


def _line_of_sight(eye: NDArray[np.float64], point: NDArray[np.float64]) -> PlacedShape:
    """A cylinder from a camera at ``eye`` to ``point``, (3,) metres, without its ends."""
    from scipy.spatial.transform import Rotation

    radius, after, before = SIGHT
    line = point - eye
    distance = float(np.linalg.norm(line))
    direction = line / distance
    rotation, _ = Rotation.align_vectors(direction, (0.0, 0.0, 1.0))
    length = distance - after - before
    return PlacedShape(Cylinder(radius, length), Pose(eye + (after + length / 2) * direction, rotation.as_quat()))
