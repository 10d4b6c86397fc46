"""Navigating: where to stand, and how to get there."""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.computation import Until, passed
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface
from behaviours.skill import Declaration, InstantSkill, Skill, SkillCondition, SkillFailure, Steps, StepsTo, SurfaceName
from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.engine import In, Out
from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Positive, WholeNumber
from bestman_bt.world_model.openness import containers_before, is_shut
from bestman_bt.world_model.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.navigation.global_planning.base import PlanningFailure
    from bestman_bt.navigation.global_planning.costmap import Costmap


# Places that could be reached from nowhere: remembered, so that plans go round them, and forgotten again.


class BelieveBlocked(InstantSkill):
    """Remember that there was nowhere to stand from where a surface could be reached.

    Doors and drawers of the same furniture that stand open then count as in its way, whenever they are open again.
    """

    surface = In[str](SurfaceName, "the surface, such as table")
    FAILS: ClassVar = UNKNOWN_SURFACE

    def act(self) -> None:
        """Writes a belief; moves nothing. What moves a door or drawer clears it."""
        world = self.skills.world
        furniture, surface = find_surface(self.skills, self.surface)
        place = f"{furniture.name}/{surface.name}"
        world.blocked.add(place)
        leaves = {f"{furniture.name}/{leaf.name}" for leaf in furniture.leaves}
        leaves.difference_update(containers_before(furniture, surface))
        world.in_the_way |= {(leaf, place) for leaf in leaves if not is_shut(world, leaf)}


class ForgetBlocked(InstantSkill):
    """Forget which surfaces could not be reached, or seen but in part, to try them once more."""

    forgotten = Out(int, "how many there were")

    def act(self) -> None:
        """Writes a belief; moves nothing."""
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


CHECK_PERIOD = 0.2
"""Seconds between two looks whether the path is still free."""
DETOUR = 1.5
"""Metres that another path may be longer to be taken at once; for a longer one, who stands in the way may go away."""
NEAR = 2.0
"""Metres before something on the path at which the base stops and waits where there is no other path."""
SUDDEN = 1.2
"""Metres: what the path meets nearer than that has come there. It may come so near that the lidar no longer sees it."""
WAIT_FOR_SHORT, WAIT_FOR_ANY = 5.0, 8.0
"""Seconds that it waits for a path that is not much longer, and for any path at all."""
PASSING = ("blocked", "tolerance", "path_blocked", "disconnected")
"""Failures that may pass: something or somebody is in the way, or a sensor is silent for a moment."""
BACK_UP = 0.8
"""Metres, at most: who waits for the robot goes on when it has gone."""
PAUSE = 2.0
"""Seconds that what failed has to recover."""
PEOPLE = 3
"""Recoveries that an ordinary failure uses up; one with a person moving nearby uses up 1."""

DRIVING_FAILS = {
    "start_blocked": "BackUp, or ClearEntireCostmap",
    "goal_blocked": "another goal: FindStandPose",
    "start_outside": "where the base believes to be is not on the map: Relocalise",
    "goal_outside": "a goal on the map",
    "no_path": "ClearEntireCostmap, or another goal: FindStandPose",
    "arm_in_the_way": "MoveArm to a posture within the base's outline, such as carry",
}
"""Failure codes of planning the base's way (``PlanningFailureReason``)."""


class NavigateTo(Skill):
    """Drive to a pose in the map frame, around what the map does not know.

    Five times a second the path is held against what the lidar sees; where it is no longer free another one is driven.
    Where there is none, the base waits. What failed is tried again after a recovery: back up, forget what was seen.
    """

    REQUIRES = ("base", "lidar")
    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    max_replans = In[int](WholeNumber, "recoveries after a block", default=5)
    path_ = Out(Path2D, "the path that is driven", port="path")
    FAILS: ClassVar = {
        **DRIVING_FAILS,
        "path_blocked": "something stands in the way for good: BelieveBlocked, or another goal by FindStandPose",
    }
    DECLARATION = Declaration(effects=("at({goal})",))

    _walked_about = False

    def execute(self) -> Steps:
        """Drive there."""
        yield from self.drive_to(self.goal)

    def drive_to(self, goal: Pose2D) -> Steps:
        """Drive to ``goal``, with recoveries; SkillFailure where they do not help."""
        most, spent = PEOPLE * self.max_replans, 0
        for attempt in count():
            self._walked_about = False
            try:
                yield from self._drive(goal)
            except (SkillFailure, *READING_ERRORS) as failure:
                spent += 1 if self._walked_about else PEOPLE
                if failure.code not in PASSING or spent > most:
                    raise
                self.feedback_message = f"{failure}; recovery {attempt + 1}"
            else:
                return
            yield from self._recover(attempt)

    def _drive(self, goal: Pose2D) -> Steps:
        """One attempt: along a path, and along another one where that is no longer free."""
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

    def _follow(self, motion: Motion[BasePose], goal: Pose2D, known: Costmap) -> StepsTo[Path2D | None]:
        """Until the drive has ended or the path is no longer free: None or another path."""
        skills, base = self.skills, self.skills.base
        while True:
            yield Until(passed(skills.clock, CHECK_PERIOD), motion)
            self._walked_about |= bool(base.layer.moving.obstacles)
            if motion.done:
                yield motion
                return None
            contact = base.blocked_at()
            if contact is None:
                continue
            ahead, _ = contact
            most = base.remaining + DETOUR
            found = yield from self._plan(goal, base.layer.on(known))
            if isinstance(found, Path2D) and found.length <= most:
                return found
            if ahead < NEAR and not motion.done:
                yield base.park()
                if ahead < SUDDEN:
                    most += yield from self._back_up()
                return (yield from self._wait_for_path(goal, known, most))

    def _wait_for_path(self, goal: Pose2D, known: Costmap, most: float) -> StepsTo[Path2D]:
        """The next path to drive; where only what the map lacks is in the way, it stands and looks until there is one.

        ``known``: what the map has. ``most``: metres; a longer one has to wait, too. SkillFailure where there is none.
        """
        from bestman_bt.navigation.global_planning.base import PlanningFailure

        base, clock = self.skills.base, self.skills.clock
        begin, failure = clock.now(), None
        while True:
            path = yield from self._plan(goal, base.layer.on(known))
            self._walked_about |= bool(base.layer.moving.obstacles)
            waited = clock.now() - begin
            if isinstance(path, Path2D) and (path.length <= most or waited > WAIT_FOR_SHORT):
                return path
            if isinstance(path, PlanningFailure):
                if failure is None:
                    without = yield from self._plan(goal, known)
                    if isinstance(without, PlanningFailure):
                        raise SkillFailure(without.reason.value, without.text)
                failure = path
                if waited > WAIT_FOR_ANY:
                    text = f"{failure.text}; something that the map does not have is in the way"
                    raise SkillFailure("path_blocked", text)
            self.feedback_message = "waiting for a free way"
            yield base.park()

    def _plan(self, goal: Pose2D, costmap: Costmap) -> StepsTo[Path2D | PlanningFailure]:
        skills = self.skills
        start, plan = skills.world.base.pose, skills.global_planning.plan
        path: Path2D | PlanningFailure = yield self.compute("global_planning", plan, start, goal, costmap)
        return path

    def _recover(self, attempt: int) -> Steps:
        """Let time pass and forget what was seen; the first and every second time back up, too, where there is room."""
        skills, base = self.skills, self.skills.base
        yield skills.computation.submit(lambda: None, PAUSE)
        try:
            if attempt % 2 == 0:
                yield from self._back_up()
            base.layer.clear()
            yield base.park()
        except (SkillFailure, *READING_ERRORS) as failure:
            if failure.code not in PASSING:
                raise

    def _back_up(self) -> StepsTo[float]:
        """Straight back as far as is free; metres."""
        room = self._room_behind()
        if room > 0.0:
            yield self.skills.base.drive(-room)
        return room

    def _room_behind(self) -> float:
        """Metres that the base can back up, up to ``BACK_UP``."""
        pose, along = self.skills.world.base.pose, np.arange(0.05, BACK_UP + 0.01, 0.05)
        x, y = pose.x - along * math.cos(pose.theta), pose.y - along * math.sin(pose.theta)
        poses = np.column_stack([x, y, np.full_like(along, pose.theta)])
        free = np.logical_and.accumulate(self.skills.seen_costmap().footprint_clearance(poses) > 0.0)
        return float(along[free][-1]) if free.any() else 0.0


class ReturnToStart(NavigateTo):
    """Drive back to where the robot stood when its tree was loaded; as ``NavigateTo`` does."""

    INPUT_PORTS: ClassVar = {
        "goal": PortInformation(
            Pose2D, required=False, description="x;y;theta in the map frame; by default the root entry 'start'"
        )
    }
    FAILS: ClassVar = {"no_start": "where it started is not known: NavigateTo a named pose"}
    DECLARATION = Declaration(effects=("at({goal})",))

    def execute(self) -> Steps:
        """Drive there."""
        goal: Pose2D | None = self.goal or self.board.get("@start")
        if goal is None:
            raise SkillFailure("no_start", "where the robot stood at the start is not known on its map")
        yield from self.drive_to(goal)


class At(SkillCondition):
    """Whether the base believes to be at a pose."""

    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    tolerance = In[float](Positive, "metres", default=0.05)
    heading_tolerance = In[float](Positive, "radians", default=0.1)
    FAILS: ClassVar = {"not_at_goal": "NavigateTo"}

    def check(self) -> tuple[str, str] | None:
        """Asks the localisation."""
        goal: Pose2D = self.goal
        pose = self.skills.world.base.pose
        distance = pose.distance_to(goal)
        turn = abs(wrap_angle(pose.theta - goal.theta))
        if distance > self.tolerance or turn > self.heading_tolerance:
            return "not_at_goal", f"{distance:.2f} m and {math.degrees(turn):.0f}° from the goal"
        return None
