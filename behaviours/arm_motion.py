"""Motions shared by arm skills: free motion, straight paths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.contacts import grasp
from behaviours.context import SkillContext
from behaviours.parameters import ArmMotionParameters
from behaviours.skill import ALGORITHM_ERRORS, Skill, SkillCoroutine, SkillFailure
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.messages import Failure, JointTrajectory, MotionErrorCode, MotionObstacle, MotionStage, Pose

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.manipulation.collision.base import CollisionWorld
    from bestman_bt.manipulation.collision.planning_scene import PlanningScene
    from bestman_bt.manipulation.motion_planning.timed_planner import TimedPlan
    from bestman_bt.world_model.world_model import HeldObject


RETREAT = 0.1
"""Default distance of straight retreats of an empty hand, metres."""
POSES_EXPLAINED = 12
"""Number of tool poses checked to explain why the hand reaches none."""

ARM_PLANNING_FAILS = {
    "start_out_of_limits": "Retreat",
    "start_in_collision": "Retreat, or BackUp",
    "start_violates_constraint": "the held object leans: CheckHeld",
    "goal_out_of_limits": "stand elsewhere: FindStandPose, NavigateTo",
    "goal_in_collision": "look again, or stand elsewhere: ScanScene, FindStandPose, NavigateTo",
    "goal_violates_constraint": "another grasp: PlanGrasp",
    "no_path": "stand elsewhere: FindStandPose, NavigateTo; or come from another posture: MoveArm",
    "timed_path_invalid": "retry; or stand elsewhere: FindStandPose, NavigateTo",
}
"""Failure codes of motion planning (``PlanningErrorCode``); ``timeout`` is common to all skills."""


def hand_contacts(skills: SkillContext, *others: str) -> list[tuple[str, str]]:
    """Return the pairs of hand and finger links with other bodies that are allowed where the hand works."""
    from bestman_bt.manipulation.collision.scene_from_world_model import hand_links

    return [(link, other) for link in hand_links(skills.robot, skills.arm.name) for other in others]


def move_free(
    skill: Skill, goals: Sequence[NDArray[np.float64]], world: CollisionWorld | None = None
) -> SkillCoroutine[None]:
    """Plan around all believed obstacles, or those in ``world``, to one of ``goals``, each (n,) radians, and move
    there. A held object that is upright stays so within ``max_held_tilt``, and keeps ``held_clearance`` where such a
    path exists. If the arm is believed to be in contact already, a small motion of increasing clearance comes first. If
    another arm has moved into the path meanwhile, the arm replans.
    """
    skills = skill.skills
    for left in reversed(range(1 if world is not None else skills.parameters.arm_motion.plans)):
        timed = yield from _free_motion(skill, goals, world)
        try:
            yield skills.arm.follow(timed.trajectory, free=True)
        except SkillFailure as failure:
            if left == 0 or failure.code != MotionErrorCode.OTHER_ARM_IN_THE_WAY:
                raise
        else:
            return


def with_held_margin(scene: PlanningScene, held: HeldObject, parameters: ArmMotionParameters) -> PlanningScene:
    """Return the scene with an enlarged held object, which may sag and sway during motion."""
    assert scene.attached is not None
    reach = float(np.linalg.norm(held.tool_from_object.position)) + max(held.model.size) / 2
    return scene.holding(replace(scene.attached, padding=max(parameters.held_clearance, parameters.held_sag * reach)))


def _free_motion(
    skill: Skill, goals: Sequence[NDArray[np.float64]], world: CollisionWorld | None
) -> SkillCoroutine[TimedPlan]:
    """Return a motion in ``world``; without it, around all believed obstacles, with clearance of a held object if such
    a path exists.
    """
    from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode

    skills = skill.skills
    timed: TimedPlan
    if world is None:
        scene = skills.planning_scene()
        if skills.held is not None:
            with suppress(MotionPlanningError):  # then with the clearance of the arm
                roomy = with_held_margin(scene, skills.held, skills.parameters.arm_motion)
                timed = yield _planned(skill, goals, skills.arm_world(roomy))
                return timed
        world = skills.arm_world(scene)
    try:
        timed = yield _planned(skill, goals, world)
    except MotionPlanningError as refusal:
        if refusal.code is not PlanningErrorCode.START_IN_COLLISION:
            raise
        yield from _recover_from_collision(skill, world)
        timed = yield _planned(skill, goals, world)
    return timed


def _planned(skill: Skill, goals: Sequence[NDArray[np.float64]], world: CollisionWorld) -> Motion[TimedPlan]:
    """Return a motion from where the arm is."""
    from bestman_bt.manipulation.motion_planning.upright import Upright

    skills = skill.skills
    start, parameters = skills.arm_positions(), skills.parameters.arm_motion
    constraint, speed = None, SpeedScale(parameters.free_speed, parameters.free_acceleration)
    if skills.held is not None:
        upright = Upright(skills.kinematics, skills.held.tool_from_object, parameters.max_held_tilt)
        constraint = upright if upright.satisfied(start) else None
        speed = SpeedScale(parameters.carrying_speed, parameters.carrying_acceleration)
    return skill.compute(
        "motion_planning",
        skills.motion_planning.plan,
        start,
        goals,
        world,
        skills.arm_model,
        skills.rng,
        speed,
        constraint,
    )


def _recover_from_collision(skill: Skill, world: CollisionWorld) -> SkillCoroutine[None]:
    """Move slowly out of a believed contact: by a small motion, else straight back from what the open hand encloses."""
    from bestman_bt.manipulation.motion_planning.base import MotionPlanningError

    skills = skill.skills
    parameters = skills.parameters.arm_motion
    try:
        trajectory = yield skill.compute(
            "motion_planning",
            skills.motion_planning.recover,
            skills.arm_positions(),
            world,
            skills.arm_model,
            skills.rng,
            SpeedScale(parameters.recovery_speed, parameters.recovery_acceleration),
        )
    except MotionPlanningError:
        handled = skills.handled
        if skills.held is not None or handled not in skills.world.objects:
            raise
        beside = skills.arm_world(skills.planning_scene(allowed_pairs=hand_contacts(skills, handled)))
        if not beside.is_free(skills.arm_positions()):
            raise
        with skill.touching(grasp(handled)):
            yield from straight_back(skill, beside, RETREAT)
    else:
        yield skills.arm.follow(trajectory)


def straight_back(skill: Skill, world: CollisionWorld, distance: float) -> SkillCoroutine[None]:
    """Move the tool straight back along its axis by ``distance`` metres, as far as the path is free."""
    from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path

    skills = skill.skills
    back = skills.base_from_tool() @ Pose(np.array([0.0, 0.0, -distance]))
    line = cartesian_path(skills.kinematics, skills.arm_positions(), back, world.is_free)
    if len(line.path) > 1:
        yield from follow_path(skill, line.path, world, speed=skills.parameters.arm_motion.retreat_speed)


def follow_path(
    skill: Skill, path: NDArray[np.float64], world: CollisionWorld, speed: float = 1.0
) -> SkillCoroutine[None]:
    """Follow joint waypoints (N, n), radians, from the current positions, at a fraction ``speed`` of the usual
    speed.
    """
    trajectory = yield from timed_path(skill, path, world, speed)
    yield skill.skills.arm.follow(trajectory)


def approach_object(
    skill: Skill,
    path: NDArray[np.float64],
    world: CollisionWorld,
    monitored: bool = True,
    on_contact: Callable[[], None] = lambda: None,
) -> SkillCoroutine[None]:
    """Follow an approach (N, n), radians, slowly; after a contact, which fails as COLLISION, the arm retraces its path.
    ``monitored``: no contact is expected; otherwise only a fault reported by the driver ends the motion.
    ``on_contact``: called before the arm retraces. If retracing also fails, the contact is still the reported failure.
    """
    skills = skill.skills
    speed = skills.parameters.arm_motion.approach_speed
    trajectory = yield from timed_path(skill, path, world, speed)
    try:
        yield skills.arm.follow(trajectory, free=monitored)
    except SkillFailure as failure:
        if failure.code != MotionErrorCode.COLLISION:
            raise
        on_contact()
        contact = failure
        if failure.failure is not None:  # the obstacle is found from where the arm is now
            met = replace(failure.failure, obstacle=skills.met(failure.failure))
            contact = SkillFailure(failure.code, str(failure), met)
        try:
            reached = int(np.argmin(np.abs(path - skills.arm_positions()).max(axis=1)))
            yield from follow_path(skill, path[max(reached, 1) :: -1], world, speed)
        except (SkillFailure, *ALGORITHM_ERRORS) as second:
            raise contact from second
        raise contact from failure


def timed_path(
    skill: Skill, path: NDArray[np.float64], world: CollisionWorld, speed: float = 1.0
) -> SkillCoroutine[JointTrajectory]:
    """Return the timed motion along ``path`` (N, n), radians. Raises MotionPlanningError if it would collide."""
    skills = skill.skills
    waypoints = np.vstack([skills.arm_positions(), path[1:]])
    parameters = skills.parameters.arm_motion
    scale = SpeedScale(parameters.free_speed * speed, parameters.free_acceleration * speed)
    trajectory: JointTrajectory = yield skill.compute(
        "trajectory", skills.motion_planning.follow_path, waypoints, world, skills.arm_model, scale
    )
    return trajectory


def unreached(
    skills: SkillContext,
    failure: SkillFailure,
    tool_poses: Iterable[Pose],
    world: CollisionWorld | None = None,
    stage: MotionStage = MotionStage.REACH,
) -> SkillFailure:
    """Return the failure of a skill whose hand cannot reach any of ``tool_poses`` (base frame), with the obstacle.

    ``world``: the arm's collision world, by default the believed one.
    """
    from bestman_bt.manipulation.motion_planning.query import in_the_way

    around = world if world is not None else skills.arm_world(skills.planning_scene())
    now, (shoulder, reach) = skills.arm_positions(), skills.kinematics.reach
    beyond = math.inf
    obstacle: MotionObstacle | None = None
    for pose in islice(tool_poses, POSES_EXPLAINED):
        result = skills.kinematics.solve(pose, now, skills.rng, attempts=5)
        if result.found:
            obstacle = in_the_way(stage, around, result.best)
            if obstacle.pairs:
                break
        else:
            away = float(np.linalg.norm(pose.position - shoulder)) - reach
            beyond = min(beyond, max(away, result.position_error))
    if obstacle is None:
        at = dict(zip(skills.arm_model.joint_names, now.tolist(), strict=True))
        obstacle = MotionObstacle(stage, beyond=beyond if math.isfinite(beyond) else None, positions=at)
    words = f"{failure} ({obstacle})"
    return SkillFailure(failure.code, words, Failure(failure.code, words, obstacle=obstacle))
