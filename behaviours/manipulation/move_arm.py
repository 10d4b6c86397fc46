"""Motions of the arm: to a posture, and retreats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from behaviours.arm_motion import ARM_PLANNING_FAILS, RETREAT, hand_contacts, move_free, straight_back, with_held_margin
from behaviours.contacts import grasp
from behaviours.context import SkillContext
from behaviours.skill import ArmNode, Declaration, PostureName, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.world_model import HeldObject

if TYPE_CHECKING:
    from bestman_bt.manipulation.collision.base import CollisionWorld
    from bestman_bt.manipulation.collision.planning_scene import SceneObstacle


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
"""Positions, (x, y, z) metres in the base frame, at which to carry a held object."""
TURNS_BESIDE = tuple(math.radians(degrees) for degrees in (0, 45, -45, 90, -90, 135, -135, 180))
"""Rotations of the hand there, relative to straight ahead."""
SAME_PLACE = 0.05
"""Distance from such a position within which the held object counts as there, metres."""
ENOUGH = 6
"""Postures among which the planner may choose."""
IN_VIEW = ((0.6, 0.0, 0.8), (0.75, 0.0, 0.8), (0.65, 0.25, 0.8), (0.65, -0.25, 0.8))
"""Points, (x, y, z) metres in the base frame, that the head camera should see: on a table in front of the robot."""
SIGHT = (0.05, 0.08, 0.1)
"""Metres: radius of the free cylinder about a line of sight, and its gaps at the camera and the point."""
ROOM_TO_TURN = (-0.42, 0.45, 0.42)
"""Bounds of the arm in the base frame, metres: smallest x, largest x, largest |y|."""


def postures_beside(
    skills: SkillContext,
    held: HeldObject,
    posture: NDArray[np.float64],
    world: CollisionWorld,
    sights: Sequence[NDArray[np.float64]] = (),
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return joint positions (n,) that hold the object upright beside the mast, for any grasp orientation.

    First those that leave the head camera's view free and do not extend over the base, then others; each nearest to the
    current ones first. If the current ones satisfy this, only they are returned. The search starts from these and
    ``posture``. ``world``: collision world to satisfy. ``sights``: points (3,), base frame, that the camera should see
    as well.
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


def with_sight_line_kept_free(skills: SkillContext, point: NDArray[np.float64]) -> CollisionWorld:
    """Return a collision world that also keeps the line of sight from head camera to a point (3,), base frame, free."""
    return _things_that_are_not_there(skills, (_lines(skills, [point]),))


def _things_that_are_not_there(skills: SkillContext, things: Sequence[SceneObstacle]) -> CollisionWorld:
    return skills.arm_world(replace(skills.planning_scene(), obstacles=tuple(things), voxels=()))


def _lines(skills: SkillContext, points: Sequence[ArrayLike]) -> SceneObstacle:
    from bestman_bt.manipulation.collision.planning_scene import SceneObstacle

    if not skills.has("camera"):
        return SceneObstacle("sight", ())
    eye = skills.camera.base_from_camera().position
    return SceneObstacle("sight", tuple(_line_of_sight(eye, np.asarray(point)) for point in points))


def _fence() -> SceneObstacle:
    """Return walls around the area in which the base can turn."""
    from bestman_bt.manipulation.collision.planning_scene import SceneObstacle

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
    """Return a cylinder from a camera at ``eye`` to ``point``, (3,) metres, without its ends."""
    from scipy.spatial.transform import Rotation

    radius, after, before = SIGHT
    line = point - eye
    distance = float(np.linalg.norm(line))
    direction = line / distance
    rotation, _ = Rotation.align_vectors(direction, (0.0, 0.0, 1.0))
    length = distance - after - before
    return PlacedShape(Cylinder(radius, length), Pose(eye + (after + length / 2) * direction, rotation.as_quat()))


LEVEL = 0.5
"""Cosine between the hand's axis and the vertical below which the hand counts as level."""
TURN = np.radians(15.0)
"""Step between the hand rotations tried to give the held object clearance, radians."""

UNKNOWN_POSTURE = {"unknown_posture": "use a posture of the robot"}


class MoveArm(ArmNode, Skill):
    """Move the arm to a posture of the robot, around all believed obstacles."""

    REQUIRES = ("arm",)
    USES = ("camera",)
    posture = In[str](PostureName, "a posture of the robot, such as carry")
    sight = In(Pose, "a place in the map that the head camera should see past the held object", required=False)
    FAILS: ClassVar = {
        **ARM_PLANNING_FAILS,
        **UNKNOWN_POSTURE,
    }
    DECLARATION = Declaration(effects=("posture({posture})",))

    def execute(self) -> SkillCoroutine[None]:
        """Plan and follow a path; succeed immediately if the arm is already at the goal."""
        place: Pose | None = self.sight
        sight = None if place is None else self.skills.map_from_base.inverse().apply(place.position[None])[0]
        yield from _move_to(self, _postures(self, self.posture, sight))


class Retreat(ArmNode, Skill):
    """Retreat the hand straight back, then move the arm to a posture."""

    REQUIRES = ("arm",)
    USES = ("camera",)
    posture = In[str](PostureName, "where to end", default="carry")
    distance = In[float](NonNegative, "straight back, metres", default=RETREAT)
    FAILS: ClassVar = {
        **ARM_PLANNING_FAILS,
        **UNKNOWN_POSTURE,
    }
    DECLARATION = Declaration(effects=("posture({posture})",))

    def execute(self) -> SkillCoroutine[None]:
        """Move back along the hand's axis as far as it is free, then to the posture by a planned path.

        An object grasped from the side may have been between boards.
        """
        skills = self.skills
        _posture(self, self.posture)  # an unknown one is reported before anything moves
        distance: float = self.distance
        if skills.held is None and distance > 0:
            scene = skills.planning_scene(allowed_pairs=hand_contacts(skills, *skills.world.objects))
            handled = skills.handled
            with self.touching(*([grasp(handled)] if handled is not None else ())):
                yield from straight_back(self, skills.arm_world(scene), distance)
        elif skills.held is not None and abs(float(skills.base_from_tool().rotation[2, 2])) < LEVEL:
            pull_out = skills.parameters.arm_motion.pull_out
            yield from straight_back(self, skills.arm_world(skills.planning_scene()), pull_out)
        yield from _move_to(self, _postures(self, self.posture))


def _move_to(skill: Skill, choices: Sequence[list[NDArray[np.float64]]]) -> SkillCoroutine[None]:
    """Move to the first of ``choices`` that can be reached; succeed immediately if the arm is already there."""
    from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode

    arrived = skill.skills.parameters.arm_motion.posture_tolerance
    for goals in choices:
        if min(np.abs(skill.skills.arm_positions() - goal).max() for goal in goals) <= arrived:
            return
        try:
            yield from move_free(skill, goals)
        except MotionPlanningError as refusal:
            if goals is choices[-1] or refusal.code is not PlanningErrorCode.NO_PATH:
                raise
        else:
            return


def _postures(skill: Skill, name: str, sight: NDArray[np.float64] | None = None) -> list[list[NDArray[np.float64]]]:
    """Return joint positions (n,) to move to, the best first: the posture itself, or alternatives with a held object.

    In order: the posture, with its last joint rotated, then postures whose names begin with its name and an underscore,
    in the same way; then any that hold the object upright beside the robot. ``sight``: a point (3,), base frame, that
    the head camera should see past the object.
    """
    from bestman_bt.manipulation.motion_planning.upright import Upright

    skills = skill.skills
    posture = _posture(skill, name)
    held = skills.held
    if held is None:
        return [[posture]]
    scene, parameters = skills.planning_scene(), skills.parameters.arm_motion
    world, roomy = skills.arm_world(scene), skills.arm_world(with_held_margin(scene, held, parameters))
    upright = Upright(skills.kinematics, held.tool_from_object, parameters.max_held_tilt)
    past = None if sight is None else with_sight_line_kept_free(skills, sight)
    tilted = not upright.satisfied(skills.arm_positions())

    def is_fit(positions: NDArray[np.float64]) -> bool:
        seen = past is None or past.is_free(positions)
        return seen and (tilted or upright.satisfied(positions)) and roomy.is_free(positions)

    others = sorted(other for other in skills.robot.postures if other.startswith(f"{name}_"))
    for basic in (posture, *(_posture(skill, other) for other in others)):
        if is_fit(basic):
            return [[basic]]
        free = [turned for turned in _turned(skill, basic) if is_fit(turned)]
        if free:
            return [[min(free, key=lambda positions: _reach(skill, positions, held))]]
    beside = postures_beside(skills, held, posture, world, () if sight is None else (sight,))
    return [goals for goals in beside if goals] or [[posture]]


def _posture(skill: Skill, name: str) -> NDArray[np.float64]:
    try:
        return skill.skills.robot.posture(name, skill.skills.arm_model.joint_names)
    except KeyError as error:
        raise SkillFailure("unknown_posture", str(error.args[0])) from error


def _turned(skill: Skill, posture: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the posture with its last joint at other angles within the limits."""
    arm = skill.skills.arm_model
    turns = np.arange(arm.lower[-1], arm.upper[-1], TURN)
    return [np.append(posture[:-1], angle) for angle in turns]


def _reach(skill: Skill, positions: NDArray[np.float64], held: HeldObject) -> float:
    """Return the horizontal distance, metres, from the middle of the base to that of the held object."""
    base_from_object = skill.skills.kinematics.tool_pose(positions) @ held.tool_from_object
    return float(np.linalg.norm(base_from_object.position[:2]))
