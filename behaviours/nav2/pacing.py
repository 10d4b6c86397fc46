"""How often a child is ticked, by how the base moves: SpeedController, DistanceController, PathLongerOnApproach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.nav2.ports import FRAMES, SERVICE, are_literals, nothing_written, without_meaning
from behaviours.navigation.navigate import At
from behaviours.skill import InstantSkill, OnRobot, SkillCondition, SkillFailure
from bestman_bt.engine import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Decorator, In, Out, StatefulAction
from bestman_bt.engine.core.ports import key_of
from bestman_bt.messages import Goals, Path2D, Pose2D
from bestman_bt.messages.shapes import Count, NonNegative, Positive, WholeNumber

# Asking of goals, and keeping them up to date: GoalReached, GoalUpdated, GlobalUpdatedGoal, RemovePassedGoals, …


WATCHED: dict[str, PortInformation] = {
    "goal": PortInformation(object, required=False, default_value="{goal}", description="what is watched"),
    "goals": PortInformation(object, required=False, default_value="{goals}", description="watched, too"),
}


OCCUPANCY = without_meaning("cost_threshold", "use_footprint", "consider_unknown_as_obstacle")
"""The footprint is asked for, always."""


class GoalReached(At):
    """Whether the base believes to be at a goal; by default within 25 cm and whichever way it faces, as Nav2's."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    tolerance_ = In[float](Positive, "metres", default=0.25, port="tolerance")
    heading_tolerance_ = In[float](Positive, "radians", default=math.pi, port="heading_tolerance")


class GoalUpdated(SkillCondition):
    """Whether ``goal`` or ``goals`` have changed since this was asked the last time; not when asked the first time."""

    INPUT_PORTS: ClassVar = WATCHED
    AT_FIRST: ClassVar = False

    def on_load(self) -> None:
        """Begin with nothing seen."""
        self._seen: tuple[Any, Any] | None = None

    def halt(self) -> None:
        """Forget what was seen: what comes then is another run."""
        self._seen = None
        super().halt()

    def check(self) -> tuple[str, str] | None:
        """Compares."""
        now = self.get_input("goal"), self.get_input("goals")
        updated = self.AT_FIRST if self._seen is None else now != self._seen
        self._seen = now
        return None if updated else ("not_updated", "the goal is still the same")


class GlobalUpdatedGoal(GoalUpdated):
    """Whether ``goal`` or ``goals`` have changed since this was asked the last time, or it is asked the first time."""

    AT_FIRST: ClassVar = True


class ArePosesNear(SkillCondition):
    """Whether two poses are within ``tolerance`` metres of one another."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    ref_pose = In(Pose2D, "x;y;theta")
    target_pose = In(Pose2D, "x;y;theta")
    tolerance = In[float](Positive, "metres", default=0.5)

    def check(self) -> tuple[str, str] | None:
        """Compares."""
        distance = self.ref_pose.distance_to(self.target_pose)
        return None if distance <= self.tolerance else ("not_near", f"{distance:.2f} m apart")


class RemovePassedGoals(InstantSkill):
    """Take the poses out of a list that the base is near to, in their order; the last one always stays."""

    INPUT_PORTS: ClassVar = {**FRAMES, **without_meaning("input_waypoint_statuses")}
    OUTPUT_PORTS: ClassVar = nothing_written("output_waypoint_statuses")
    input_goals = In(Goals, "x;y;theta;x;y;theta, in driving order")
    radius = In[float](NonNegative, "metres that count as passed", default=0.5)
    output_goals = Out(Goals, "those that are left", required=True)

    def act(self) -> None:
        """Compare with where the base is."""
        goals: Goals = self.input_goals
        pose, passed = self.skills.world.base.pose, 0
        while passed < len(goals) - 1 and pose.distance_to(goals[passed]) <= self.radius:
            passed += 1
        self.output_goals = Goals(goals[passed:])


class RemoveInCollisionGoals(InstantSkill):
    """Take the poses out of a list at which the base would touch what is known or seen."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVICE, **OCCUPANCY, **without_meaning("input_waypoint_statuses")}
    OUTPUT_PORTS: ClassVar = nothing_written("output_waypoint_statuses")
    input_goals = In(Goals, "x;y;theta;x;y;theta")
    output_goals = Out(Goals, "those that are left", required=True)

    def act(self) -> None:
        """Ask the costmap."""
        goals: Goals = self.input_goals
        free = _is_free(self, goals)
        self.output_goals = Goals(goal for goal, kept in zip(goals, free, strict=True) if kept)


class CheckPoseOccupancy(InstantSkill):
    """Whether the base could stand at a pose, by what is known and seen; fails where it would touch something."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVICE, **OCCUPANCY}
    pose = In(Pose2D, "x;y;theta in the map frame")
    FAILS: ClassVar = {"goal_blocked": "another pose"}

    def act(self) -> None:
        """Ask the costmap."""
        pose: Pose2D = self.pose
        if not _is_free(self, (pose,))[0]:
            raise SkillFailure("goal_blocked", f"the base would touch something at ({pose.x:.2f}, {pose.y:.2f}) m")


def _is_free(node: OnRobot, poses: Sequence[Pose2D]) -> list[bool]:
    """At which poses the base touches nothing."""
    if not poses:
        return []
    rows = np.array([[pose.x, pose.y, pose.theta] for pose in poses])
    return [bool(clear) for clear in node.skills.seen_costmap().footprint_clearance(rows) > 0.0]


class GetNextFewGoals(InstantSkill):
    """The first poses of a list."""

    num_goals = In[int](Count, "how many, at most")
    input_goals = In(Goals, "x;y;theta;x;y;theta, in driving order")
    output_goals = Out(Goals, "the first of them")
    FAILS: ClassVar = {"no_goals": "give a pose"}

    def act(self) -> None:
        """Cut."""
        goals: Goals = self.input_goals
        if not goals:
            raise SkillFailure("no_goals", "there is no pose")
        self.output_goals = Goals(goals[: self.num_goals])


class AppendGoalPoseToGoals(InstantSkill):
    """A list of poses with one more at its end."""

    goal_pose = In(Pose2D, "x;y;theta")
    input_goals = In(Goals, "x;y;theta;x;y;theta; none is an empty list", required=False)
    output_goals = Out(Goals, "with it")

    def act(self) -> None:
        """Append."""
        self.output_goals = Goals((*(self.input_goals or ()), self.goal_pose))


class GetCurrentPose(InstantSkill):
    """Where the base believes to be, in the map frame."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    current_pose = Out(Pose2D, "x;y;theta")

    def act(self) -> None:
        """Ask the localisation."""
        self.current_pose = self.skills.world.base.pose


class CheckStopStatus(OnRobot, StatefulAction):
    """SUCCESS once the base has stood for ``duration_stopped``; RUNNING while it stands, FAILURE where it moves."""

    REQUIRES = ("base", "lidar")
    velocity_threshold = In[float](Positive, "m/s and rad/s", default=0.01)
    duration_stopped = In[int](WholeNumber, "milliseconds", default=1000)

    def on_start(self) -> int:
        """Note the time."""
        self._since = self.clock.now()
        return self.on_running()

    def on_running(self) -> int:
        """Look at the measured velocity."""
        velocity = self.skills.base.velocity()
        if max(math.hypot(velocity.vx, velocity.vy), abs(velocity.wz)) > self.velocity_threshold:
            return FAILURE
        return SUCCESS if self.clock.now() - self._since >= self.duration_stopped * 1e-3 else RUNNING

    def on_halted(self) -> None:
        """Nothing moves by looking."""


class DistanceTraveled(SkillCondition):
    """True once the base has come ``distance`` metres farther than where this was true, or asked the first time."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    distance = In[float](Positive, "metres, Euclidean distance", default=1.0)
    FAILS: ClassVar = {"not_travelled": "nothing is wrong"}

    def on_load(self) -> None:
        """Begin nowhere."""
        self._from: Pose2D | None = None

    def halt(self) -> None:
        """Forget where it began."""
        self._from = None
        super().halt()

    def check(self) -> tuple[str, str] | None:
        """Compares."""
        pose = self.skills.world.base.pose
        self._from = self._from or pose
        travelled = pose.distance_to(self._from)
        if travelled < self.distance:
            return "not_travelled", f"{travelled:.2f} m so far"
        self._from = pose
        return None


class TimeExpired(SkillCondition):
    """True once ``seconds`` after this was true, or asked the first time."""

    seconds = In[float](Positive, "seconds", default=1.0)
    FAILS: ClassVar = {"not_expired": "nothing is wrong"}

    def on_load(self) -> None:
        """Begin with no time running."""
        self._since: float | None = None

    def halt(self) -> None:
        """Forget when it began."""
        self._since = None
        super().halt()

    def check(self) -> tuple[str, str] | None:
        """Looks at the clock."""
        now = self.clock.now()
        self._since = now if self._since is None else self._since
        if now - self._since < self.seconds:
            return "not_expired", f"{now - self._since:.1f} s so far"
        self._since = now
        return None


class GoalUpdater(Decorator):
    """Hand a goal on to the child, and the one that was written to ``goal_update`` since then instead.

    ``goal_update`` and ``goals_update`` are entries, by default of the root, that somebody outside writes:
    ``blackboard.set``, the control channel. As with Nav2's topics, what is older than the goal does not count.
    """

    input_goal = In(Pose2D, "x;y;theta", required=False)
    input_goals = In(Goals, "x;y;theta;x;y;theta", required=False)
    goal_update = In(object, "x;y;theta", default="{@goal_update}")
    goals_update = In(object, "x;y;theta;x;y;theta", default="{@goals_update}")
    output_goal = Out(Pose2D, "the newer one of both")
    output_goals = Out(Goals, "the newer ones of both")

    def on_tick(self) -> int:
        """Choose, then tick the child."""
        for what in ("goal", "goals"):
            given, update = self.get_input(f"input_{what}"), self.get_input(f"{what}_update")
            chosen = update if update is not None and self._is_newer(what) else given
            if chosen is not None:
                self.set_output(f"output_{what}", chosen)
        return self.child.execute_tick()

    def _is_newer(self, what: str) -> bool:
        return self._written(f"{what}_update") >= self._written(f"input_{what}")

    def _written(self, port: str) -> float:
        """When the entry that a port leads to was written, seconds; a literal was there before everything."""
        default = self.INPUT_PORTS[port].default_value
        key = key_of(self.attributes.get(port, default), port)
        return -math.inf if key is None else self.board.slot(key).stamp


class SpeedController(OnRobot, Decorator):
    """Tick the child the more often the faster the base is; at once where it starts, and where the goal changes.

    Between ``min_speed`` and ``max_speed`` the rate goes from ``min_rate`` to ``max_rate``. RUNNING in between.
    """

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**WATCHED}
    min_rate = In[float](Positive, "hertz, above 0", default=0.1)
    max_rate = In[float](Positive, "hertz", default=1.0)
    min_speed = In[float](NonNegative, "m/s", default=0.0)
    max_speed = In[float](Positive, "m/s", default=0.5)

    def on_load(self) -> None:
        """Begin with no time running; judge the limits where all are literals."""
        self._since, self._period, self._due = 0.0, 0.0, True
        self._goals: tuple[Any, Any] = (None, None)
        if are_literals(self, "min_rate", "max_rate", "min_speed", "max_speed"):
            self._limits()

    def on_tick(self) -> int:
        """Tick the child if it runs or is due."""
        now, goals = self.clock.now(), (self.get_input("goal"), self.get_input("goals"))
        if self._s <= IDLE or goals != self._goals:
            self._goals, self._since, self._due = goals, now, True
            self._period = 1.0 / self.max_rate
        self.set_state(RUNNING)
        over = now - self._since >= self._period
        if not (self._due or over or self.child._s == RUNNING):
            return RUNNING
        self._due = False
        if over:
            self._since, self._period = now, 1.0 / self._rate()
        return self.child.execute_tick()

    def _rate(self) -> float:
        """Hertz at which the base's speed asks for the child."""
        low, high, slow, fast = self._limits()
        velocity = self.skills.base.velocity()
        share = (math.hypot(velocity.vx, velocity.vy) - slow) / (fast - slow)
        return float(low + min(max(share, 0.0), 1.0) * (high - low))

    def _limits(self) -> tuple[float, float, float, float]:
        low, high = self.min_rate, self.max_rate
        slow, fast = self.min_speed, self.max_speed
        if low > high:
            raise self.error(f"min_rate is {low} Hz and max_rate {high} Hz, but the minimum is not above the maximum")
        if slow >= fast:
            raise self.error(f"min_speed is {slow} m/s and max_speed {fast} m/s, but the minimum is below the maximum")
        return low, high, slow, fast


class DistanceController(OnRobot, Decorator):
    """Tick the child where it starts, and whenever the base has come ``distance`` metres farther; RUNNING between."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    distance = In[float](Positive, "metres, Euclidean distance", default=1.0)

    def on_load(self) -> None:
        """Begin nowhere."""
        self._from, self._due = Pose2D(), True

    def on_tick(self) -> int:
        """Tick the child if it runs or is due."""
        pose = self.skills.world.base.pose
        if self._s <= IDLE:
            self._from, self._due = pose, True
        self.set_state(RUNNING)
        travelled = pose.distance_to(self._from)
        if not (self._due or travelled >= self.distance or self.child._s == RUNNING):
            return RUNNING
        self._due = False
        status = self.child.execute_tick()
        if status == SUCCESS:
            self._from = pose
        return status


class PathLongerOnApproach(Decorator):
    """Tick the child where a new path close to the goal is much longer than the one before it; else SUCCESS.

    That is what a blocked approach looks like: waiting may be better than going all the way round.
    """

    path_ = In(Path2D, "the path that is planned again and again", required=False, port="path")
    prox_len = In[float](Positive, "metres that count as close", default=3.0)
    length_factor = In[float](Positive, "that counts as longer", default=2.0)

    def on_load(self) -> None:
        """Begin with no path."""
        self._before: Path2D | None = None

    def halt(self) -> None:
        """Forget the path."""
        self._before = None
        super().halt()

    def on_tick(self) -> int:
        """Compare the path with the one before."""
        path: Path2D | None = self.path_
        if self.child._s != RUNNING and not self._is_longer(path):
            self._before = path
            return SUCCESS
        self.set_state(RUNNING)
        status = self.child.execute_tick()
        if status not in (RUNNING, SKIPPED):
            self._before = path
        return status

    def _is_longer(self, path: Path2D | None) -> bool:
        """Whether ``path`` leads to the same goal as the one before, and that one was short and this one is not."""
        before = self._before
        if path is None or before is None or path is before or path.goal != before.goal:
            return False
        short = before.length < self.prox_len
        return bool(short and path.length > self.length_factor * before.length)
