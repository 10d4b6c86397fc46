"""Navigation: planning and driving, with replanning and recoveries."""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from py_trees.ports import PortInformation
from typing_extensions import override

from behaviours.computation import Until, passed
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface
from behaviours.skill import Declaration, InstantSkill, Skill, SkillCondition, SkillCoroutine, SkillFailure, SurfaceName
from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.engine import In, Out
from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import NonNegativeInt, Positive
from bestman_bt.world_model.openness import containers_before, is_shut
from bestman_bt.world_model.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.navigation.global_planning.base import PlanningFailure
    from bestman_bt.navigation.global_planning.costmap import Costmap


class BelieveBlocked(InstantSkill):
    """Remember that no base placement could reach a surface.

    Open doors and drawers of the same furniture then count as obstacles to it, whenever they are open again.
    """

    surface = In[str](SurfaceName, "the surface, such as table")
    FAILS: ClassVar = UNKNOWN_SURFACE

    def act(self) -> None:
        """Set the belief; no motion. The next motion of the door or drawer clears it."""
        world = self.skills.world
        furniture, surface = find_surface(self.skills, self.surface)
        place = f"{furniture.name}/{surface.name}"
        world.blocked.add(place)
        doors = {f"{furniture.name}/{door.name}" for door in furniture.articulations}
        doors.difference_update(containers_before(furniture, surface))
        world.in_the_way |= {(door, place) for door in doors if not is_shut(world, door)}


class ForgetBlocked(InstantSkill):
    """Forget which surfaces could not be reached, or only partly seen, to try them again."""

    forgotten = Out(int, "number of forgotten surfaces")

    def act(self) -> None:
        """Clear the belief; no motion."""
        world = self.skills.world
        in_part = {place for _, place in world.searched_in_part}
        blocked = world.blocked | {place for _, place in world.in_the_way}
        self.forgotten = len(blocked) + len(world.searched_in_part)
        self.feedback_message = ", ".join(sorted(blocked | in_part))
        world.blocked.clear()
        world.in_the_way.clear()
        for searched in world.searched_in_part:
            world.searched.pop(searched, None)
        world.searched_in_part.clear()


RECOVERABLE_CODES = ("blocked", "tolerance", "path_blocked", "disconnected", "no_data")
"""Temporary failures: an obstacle or person on the path, or a sensor that is silent for a moment."""

DRIVING_FAILS = {
    "start_blocked": "BackUp, or ClearEntireCostmap",
    "goal_blocked": "another goal: FindStandPose",
    "start_outside": "the believed base pose is off the map: Relocalise",
    "goal_outside": "a goal on the map",
    "no_path": "ClearEntireCostmap, or another goal: FindStandPose",
    "arm_in_the_way": "MoveArm to a posture within the base's outline, such as carry",
}
"""Failure codes of global planning (``PlanningFailureReason``)."""


class NavigateTo(Skill):
    """Drive to a pose in the map frame, around obstacles that the map does not contain.

    The path is checked against the lidar five times a second. If it is blocked, the base follows another one; if there
    is none, the base waits. A failed drive is retried after a recovery: back up, forget the seen obstacles.
    """

    REQUIRES = ("base", "lidar")
    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    max_replans = In[int](NonNegativeInt, "recoveries after a block", default=5)
    path_ = Out(Path2D, "the current path", port="path")
    FAILS: ClassVar = {
        **DRIVING_FAILS,
        "path_blocked": "a permanent obstacle: BelieveBlocked, or another goal by FindStandPose",
    }
    DECLARATION = Declaration(effects=("at({goal})",))

    _moving_obstacle_seen = False

    def execute(self) -> SkillCoroutine[None]:
        """Drive to the pose."""
        yield from self.drive_to(self.goal)

    def drive_to(self, goal: Pose2D) -> SkillCoroutine[None]:
        """Drive to ``goal``, with recoveries. Raises SkillFailure if they do not help."""
        people = self.skills.parameters.navigate.people_factor
        most, spent = people * self.max_replans, 0
        for attempt in count():
            self._moving_obstacle_seen = False
            try:
                yield from self._drive(goal)
            except (SkillFailure, *READING_ERRORS) as failure:
                spent += 1 if self._moving_obstacle_seen else people
                if failure.code not in RECOVERABLE_CODES or spent > most:
                    raise
                self.feedback_message = f"{failure}; recovery {attempt + 1}"
            else:
                return
            yield from self._recover(attempt)

    def _drive(self, goal: Pose2D) -> SkillCoroutine[None]:
        """Make one attempt: along a path, and along another one if it is no longer free."""
        base, known = self.skills.base, self.skills.known_costmap()
        path = yield from self._wait_for_path(goal, known, math.inf)
        while True:
            other: Path2D | None = None
            self.path_ = path
            self.feedback_message = f"driving {path.length:.1f} m"
            motion = base.follow(path, known)
            try:
                other = yield from self._follow(motion, goal, known)
            finally:
                if other is None:  # halted while a plan is made: nothing may move on
                    motion.cancel()
            if other is None:
                return
            path = other

    def _follow(self, motion: Motion[BasePose], goal: Pose2D, known: Costmap) -> SkillCoroutine[Path2D | None]:
        """Wait until the drive has ended or the path is no longer free; return None or another path."""
        skills, base, parameters = self.skills, self.skills.base, self.skills.parameters.navigate
        while True:
            yield Until(passed(skills.clock, parameters.check_period), motion)
            self._moving_obstacle_seen |= bool(base.layer.moving.obstacles)
            if motion.done:
                yield motion
                return None
            contact = base.blocked_at()
            if contact is None:
                continue
            ahead, _ = contact
            most = base.remaining + parameters.max_detour
            found = yield from self._plan(goal, base.layer.on(known))
            if isinstance(found, Path2D) and found.length <= most:
                return found
            if ahead < parameters.stop_distance and not motion.done:
                yield base.park()
                if ahead < parameters.sudden_distance:
                    most += yield from self._back_up()
                return (yield from self._wait_for_path(goal, known, most))

    def _wait_for_path(self, goal: Pose2D, known: Costmap, most: float) -> SkillCoroutine[Path2D]:
        """Return the next path to drive; if only unmapped obstacles block all paths, wait until there is one.

        ``known``: the map. ``most``: metres; a longer path also leads to waiting. Raises SkillFailure if there is none.
        """
        from bestman_bt.navigation.global_planning.base import PlanningFailure

        base, clock, parameters = self.skills.base, self.skills.clock, self.skills.parameters.navigate
        begin, failure = clock.now(), None
        while True:
            path = yield from self._plan(goal, base.layer.on(known))
            self._moving_obstacle_seen |= bool(base.layer.moving.obstacles)
            waited = clock.now() - begin
            if isinstance(path, Path2D) and (path.length <= most or waited > parameters.wait_for_short):
                return path
            if isinstance(path, PlanningFailure):
                if failure is None:
                    without = yield from self._plan(goal, known)
                    if isinstance(without, PlanningFailure):
                        raise SkillFailure(without.reason.value, without.text)
                failure = path
                if waited > parameters.wait_for_any:
                    text = f"{failure.text}; an obstacle that is not on the map blocks the path"
                    raise SkillFailure("path_blocked", text)
            self.feedback_message = "waiting for a free path"
            yield base.park()

    def _plan(self, goal: Pose2D, costmap: Costmap) -> SkillCoroutine[Path2D | PlanningFailure]:
        skills = self.skills
        start, plan = skills.world.base.pose, skills.global_planning.plan
        path: Path2D | PlanningFailure = yield self.compute("global_planning", plan, start, goal, costmap)
        return path

    def _recover(self, attempt: int) -> SkillCoroutine[None]:
        """Wait and forget the seen obstacles; the first and every second time also back up, if there is room."""
        skills, base = self.skills, self.skills.base
        yield skills.computation.submit(lambda: None, skills.parameters.navigate.retry_pause)
        try:
            if attempt % 2 == 0:
                yield from self._back_up()
            base.layer.clear()
            yield base.park()
        except (SkillFailure, *READING_ERRORS) as failure:
            if failure.code not in RECOVERABLE_CODES:
                raise

    def _back_up(self) -> SkillCoroutine[float]:
        """Drive straight back as far as there is room; return the distance, metres."""
        room = self._room_behind()
        if room > 0.0:
            yield self.skills.base.drive(-room)
        return room

    def _room_behind(self) -> float:
        """Return the distance, metres, that the base can back up, at most the parameter ``back_up``."""
        farthest = self.skills.parameters.navigate.back_up
        pose, along = self.skills.world.base.pose, np.arange(0.05, farthest + 0.01, 0.05)
        x, y = pose.x - along * math.cos(pose.theta), pose.y - along * math.sin(pose.theta)
        poses = np.column_stack([x, y, np.full_like(along, pose.theta)])
        free = np.logical_and.accumulate(self.skills.seen_costmap().footprint_clearance(poses) > 0.0)
        return float(along[free][-1]) if free.any() else 0.0


class ReturnToStart(NavigateTo):
    """Drive back to the pose of the robot when its tree was loaded, as ``NavigateTo`` does."""

    INPUT_PORTS: ClassVar = {
        "goal": PortInformation(
            Pose2D, required=False, description="x;y;theta in the map frame; by default the root entry 'start'"
        )
    }
    FAILS: ClassVar = {"no_start": "the start pose is unknown: NavigateTo a named pose"}
    DECLARATION = Declaration(effects=("at({goal})",))

    @override
    def execute(self) -> SkillCoroutine[None]:
        goal: Pose2D | None = self.goal or self.board.get("@start")
        if goal is None:
            raise SkillFailure("no_start", "the robot's start pose is not known on its map")
        yield from self.drive_to(goal)


class At(SkillCondition):
    """Check whether the base is believed to be at a pose."""

    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    tolerance = In[float](Positive, "metres", default=0.05)
    heading_tolerance = In[float](Positive, "radians", default=0.1)
    FAILS: ClassVar = {"not_at_goal": "NavigateTo"}

    def check(self) -> tuple[str, str] | None:
        """Compare the believed base pose with the given one."""
        goal: Pose2D = self.goal
        pose = self.skills.world.base.pose
        distance = pose.distance_to(goal)
        turn = abs(wrap_angle(pose.theta - goal.theta))
        if distance > self.tolerance or turn > self.heading_tolerance:
            return "not_at_goal", f"{distance:.2f} m and {math.degrees(turn):.0f}° from the goal"
        return None
