"""Following a door or drawer, for skills that also need the distance covered by a failed motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from behaviours.arm_motion import ARM_PLANNING_FAILS, follow_path, move_free
from behaviours.computation import Until
from behaviours.context import SkillContext
from behaviours.furniture.articulation import UNKNOWN_ARTICULATION, FurnitureArticulation, world_at_opening
from behaviours.furniture.articulation_measurement import grown
from behaviours.skill import ALGORITHM_ERRORS, Skill, SkillCoroutine, SkillFailure
from bestman_bt.messages import Pose
from bestman_bt.world_model.world_model import Obstacle

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.control.arm.constraint_following import FollowedMotion, FollowEnd
    from bestman_bt.manipulation.collision.base import CollisionWorld


def tare_wrist(skill: Skill) -> SkillCoroutine[None]:
    """Measure the wrist sensor's offset with the hand at rest and without contact; do nothing without such a sensor.

    Ends when the readings are collected; if the hand moved, the previous offset is kept.
    """
    wrist = skill.skills.wrist_wrench
    if wrist is not None:
        wrist.tare()
        yield Until(lambda: not wrist.taring)


FELT = 0.012
"""Position error of the boards of a door that is measured by contact, metres."""
UNSURE = {"revolute": 0.06, "prismatic": 0.015}
"""Uncertainty of an opening that was measured by the hand's path, radians or metres."""


def retreat(
    skill: Skill, door: FurnitureArticulation, posture: str, felt: Obstacle | None = None
) -> SkillCoroutine[None]:
    """Retreat straight back, then move the arm to the named posture.

    ``felt``: the door as measured by contact; by default, the map is used. The hand may start closer to the door than
    the map's error allows; the arm only if it is already that close.
    """
    from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path
    from bestman_bt.manipulation.motion_planning.base import MotionPlanningError

    skills = skill.skills
    position = skills.world.articulations.get(door.name, 0.0)
    for bodies in ([], door.bodies()):
        world = world_at_opening(skills, door, position, "hand", ignore=bodies, felt=felt)
        if world.is_free(skills.arm_positions()):
            break
    back = skills.base_from_tool() @ Pose(np.array([0.0, 0.0, -skills.parameters.furniture.retreat]))
    line = cartesian_path(skills.kinematics, skills.arm_positions(), back, world.is_free)
    if len(line.path) > 1:
        yield from follow_path(skill, line.path, world, skills.parameters.arm_motion.retreat_speed)
    goals = [skills.robot.posture(posture, skills.arm_model.joint_names)]
    refusal: MotionPlanningError | None = None
    for around in _around(skills, door, position, felt):
        try:
            yield from move_free(skill, goals, around)
        except MotionPlanningError as error:
            refusal = refusal or error  # close to the door there may be a way with less margin
        else:
            return
    assert refusal is not None
    raise refusal


def _around(
    skills: SkillContext, door: FurnitureArticulation, position: float, felt: Obstacle | None
) -> Iterator[CollisionWorld]:
    """Yield collision worlds for the arm's retreat that it is clear of, the door with ever less margin.

    They include the door as felt, so as not to push it. If the arm is already inside that door, the door is omitted:
    the grip was lost earlier, and the hand moved on alone. Other contacts of the arm, such as with itself, are no
    evidence.
    """
    mapped: list[dict[str, Any]] = [{"margin": UNSURE[door.articulation.kind]}, {"margin": 0.0}]
    measured: list[dict[str, Any]] = [] if felt is None else [{"felt": grown(felt, FELT)}, {"felt": felt}]
    positions = skills.arm_positions()
    for doors in (measured, mapped):
        clear = False
        for included in doors:
            world = world_at_opening(skills, door, position, "free", **included)
            if not any(door.name in pair for pair in world.colliding_pairs(positions)):
                clear = True
                yield world
        if clear:
            return
    yield world_at_opening(skills, door, position, "free", ignore=(door.name,))


def retreat_after_failure(
    skill: Skill, door: FurnitureArticulation, posture: str, failure: Exception, felt: Obstacle | None = None
) -> SkillCoroutine[None]:
    """Retreat after a failure; if that fails as well, raise the first failure."""
    try:
        yield from retreat(skill, door, posture, felt)
    except (SkillFailure, *ALGORITHM_ERRORS) as second:
        skill.explain("not_withdrawn", f"the hand could not be withdrawn: {second}")
        raise failure from second


FOLLOWING_FAILS = {
    "locked": "it does not move at all: BelieveLocked, and use another one",
    "jammed": "it got stuck on the way: move it back by Close or Open, then retry",
    "grip_lost": "the hand slipped off: FindLookStand, DetectHandle, then retry",
    "obstacle": "something pushes the hand aside: look again, from another stand",
    "out_of_reach": "stand elsewhere: FindOpenStand or FindCloseStand, NavigateTo",
}
"""Failure codes of following a door or drawer; ``timeout`` is common to all skills."""
LEAF_FAILS = {
    **UNKNOWN_ARTICULATION,
    **ARM_PLANNING_FAILS,
    **FOLLOWING_FAILS,
    "hand_not_empty": "put the held object down: FindPlacePose, PlaceOn, Release",
    "not_withdrawn": "Retreat",
}


def error_code(end: FollowEnd, reached: str = "") -> str:
    """Return the error code of a failed following; ``reached``: the code if it ended too early, at the joint's
    limit.
    """
    from bestman_bt.control.arm.constraint_following import FollowEnd

    codes = {
        FollowEnd.REACHED: reached,
        FollowEnd.LOCKED: "locked",
        FollowEnd.JAMMED: "jammed",
        FollowEnd.GRIP_LOST: "grip_lost",
        FollowEnd.OBSTACLE: "obstacle",
        FollowEnd.ARM_LIMIT: "out_of_reach",
        FollowEnd.TIMEOUT: "timeout",
    }
    return codes[end]


def followed(following: Motion[FollowedMotion]) -> SkillCoroutine[tuple[FollowedMotion, SkillFailure | None]]:
    """Return the motion, and the failure that ended it early, or None. Raises SkillFailure without a motion."""
    failure: SkillFailure | None = None
    try:
        yield following
    except SkillFailure as error:
        if following.result is None:
            raise
        failure = error
    assert following.result is not None
    return following.result, failure
