"""Moving the arm: to a posture, and out of a place where the hand has worked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import ARM_PLANNING_FAILS, MAX_HELD_TILT, follow_path, hand_contacts, move_free
from behaviours.carrying import out_of_sight, postures_beside
from behaviours.contacts import grasp
from behaviours.names import PostureName
from behaviours.skill import Declaration, OnArm, Skill, SkillFailure, Steps
from bestman_bt.engine import In
from bestman_bt.messages import Pose
from bestman_bt.world_model import HeldObject

if TYPE_CHECKING:
    from bestman_bt.manipulation.collision import CollisionWorld, PlanningScene

PULL_OUT = 0.30
"""Metres straight back with something that was taken from the side."""
LEVEL = 0.5
"""Cosine between the hand's axis and the vertical below which the hand counts as level."""
ARRIVED = 0.02
"""Radians within which a posture counts as reached."""
ROOM = 0.012
"""Metres that what is held keeps from the robot itself and all else in a posture, where one has that room."""
TURN = np.radians(15.0)
"""Radians between the turns of the hand that are tried so that what it holds has room."""

UNKNOWN_POSTURE = {"unknown_posture": "name a posture of the robot"}


class MoveArm(OnArm, Skill):
    """Move the arm to a posture of the robot, around everything that is believed to be there."""

    REQUIRES = ("arm",)
    USES = ("camera",)
    posture = In[str](PostureName, "a posture of the robot, such as carry")
    sight = In(Pose, "a place in the map that the head camera shall see past what is held", required=False)
    FAILS: ClassVar = {
        **ARM_PLANNING_FAILS,
        **UNKNOWN_POSTURE,
    }
    DECLARATION = Declaration(effects=("posture({posture})",))

    def execute(self) -> Steps:
        """Plan and follow; at once done where the arm is there already."""
        place: Pose | None = self.sight
        sight = None if place is None else self.skills.map_from_base.inverse().apply(place.position[None])[0]
        yield from _move_to(self, _postures(self, self.posture, sight))


class Retreat(OnArm, Skill):
    """Take the hand straight back from where it has worked, then move the arm to a posture."""

    REQUIRES = ("arm",)
    USES = ("camera",)
    posture = In[str](PostureName, "where to end", default="carry")
    distance = In(float, "straight back, metres", default=0.1)
    FAILS: ClassVar = {
        **ARM_PLANNING_FAILS,
        **UNKNOWN_POSTURE,
    }
    DECLARATION = Declaration(effects=("posture({posture})",))

    def execute(self) -> Steps:
        """Back along the hand's own axis as far as that is free, then on; with something in a level hand, too.

        What was taken from the side may have come from between boards.
        """
        skills = self.skills
        _posture(self, self.posture)  # an unknown one is told before anything moves
        distance: float = self.distance
        if skills.held is None and distance > 0:
            scene = skills.planning_scene(allowed_pairs=hand_contacts(skills, *skills.world.objects))
            handled = skills.handled
            with self.touching(*([grasp(handled)] if handled is not None else ())):
                yield from self._straight_back(skills.arm_world(scene), distance)
        elif skills.held is not None and abs(float(skills.base_from_tool().rotation[2, 2])) < LEVEL:
            yield from self._straight_back(skills.arm_world(skills.planning_scene()), PULL_OUT)
        yield from _move_to(self, _postures(self, self.posture))

    def _straight_back(self, world: CollisionWorld, distance: float) -> Steps:
        """As far as that is free."""
        from bestman_bt.manipulation.kinematics import cartesian_path

        skills = self.skills
        back = skills.base_from_tool() @ Pose(np.array([0.0, 0.0, -distance]))
        line = cartesian_path(skills.kinematics, skills.arm_positions(), back, world.is_free)
        if len(line.path) > 1:
            yield from follow_path(self, line.path, world, speed=0.5)


def _move_to(skill: Skill, choices: Sequence[list[NDArray[np.float64]]]) -> Steps:
    """Go to one of the first of ``choices`` to which there is a way; at once done where the arm is there already."""
    from bestman_bt.manipulation.motion_planning import PlanningError, PlanningErrorCode

    for goals in choices:
        if min(np.abs(skill.skills.arm_positions() - goal).max() for goal in goals) <= ARRIVED:
            return
        try:
            yield from move_free(skill, goals)
        except PlanningError as refusal:
            if goals is choices[-1] or refusal.code is not PlanningErrorCode.NO_PATH:
                raise
        else:
            return


def _postures(skill: Skill, name: str, sight: NDArray[np.float64] | None = None) -> list[list[NDArray[np.float64]]]:
    """Joint positions (n,) to go to, the best choices first: the posture itself, or with something in the hand others.

    Tried in turn: the posture, then with its last joint turned, then the postures whose names begin with its name and
    an underscore, in the same way; then any that hold it upright beside the robot. ``sight``: a point (3,), base frame,
    that the head camera shall see past what is held.
    """
    from bestman_bt.manipulation.motion_planning import Upright

    skills = skill.skills
    posture = _posture(skill, name)
    held = skills.held
    if held is None:
        return [[posture]]
    scene = skills.planning_scene()
    world, roomy = skills.arm_world(scene), skills.arm_world(_with_room(scene))
    upright = Upright(skills.kinematics, held.tool_from_object, MAX_HELD_TILT)
    past = None if sight is None else out_of_sight(skills, sight)
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


def _with_room(scene: PlanningScene) -> PlanningScene:
    """The scene with what is held taken to be larger: it may sag and sway on the way."""
    assert scene.attached is not None
    return scene.holding(replace(scene.attached, padding=ROOM))


def _turned(skill: Skill, posture: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The posture with its last joint at other angles within the limits."""
    arm = skill.skills.arm_model
    turns = np.arange(arm.lower[-1], arm.upper[-1], TURN)
    return [np.append(posture[:-1], angle) for angle in turns]


def _reach(skill: Skill, positions: NDArray[np.float64], held: HeldObject) -> float:
    """Metres from the middle of the base to the middle of what the hand holds, horizontally."""
    base_from_object = skill.skills.kinematics.tool_pose(positions) @ held.tool_from_object
    return float(np.linalg.norm(base_from_object.position[:2]))
