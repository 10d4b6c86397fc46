"""Nav2's nodes about goals and the motion of the base, including decorators that limit the tick rate of a child."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from behaviours.nav2.ports import FRAMES, SERVICE, are_literals, nothing_written, without_meaning
from behaviours.navigation.navigate import At
from behaviours.skill import InstantSkill, RobotNode, SkillCondition, SkillFailure
from bestman_bt.engine import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Decorator, In, Node, Out, StatefulAction
from bestman_bt.engine.core.ports import key_of
from bestman_bt.messages import Goals, Path2D, Pose2D
from bestman_bt.messages.shapes import Count, NonNegative, NonNegativeInt, Positive


class WatchesGoals(Node):
    """A node that watches goals for a change."""

    goal = In(object, "the watched goal", default="{goal}")
    goals = In(object, "also watched", default="{goals}")


OCCUPANCY = without_meaning("cost_threshold", "use_footprint", "consider_unknown_as_obstacle")
"""The footprint is always checked."""


class GoalReached(At):
    """Check whether the base is believed to be at a goal; by default within 25 cm and any heading, as in Nav2."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    tolerance_ = In[float](Positive, "metres", default=0.25, port="tolerance")
    heading_tolerance_ = In[float](Positive, "radians", default=math.pi, port="heading_tolerance")


class GoalUpdated(WatchesGoals, SkillCondition):
    """Check whether ``goal`` or ``goals`` have changed since the last check; false at the first one."""

    AT_FIRST: ClassVar = False

    def on_load(self) -> None:
        """Reset the last goals."""
        self._seen: tuple[Any, Any] | None = None

    def halt(self) -> None:
        """Forget the last goals: the next check belongs to another run."""
        self._seen = None
        super().halt()

    def check(self) -> tuple[str, str] | None:
        """Compare with the last goals."""
        now = self.goal, self.goals
        updated = self.AT_FIRST if self._seen is None else now != self._seen
        self._seen = now
        return None if updated else ("not_updated", "the goal has not changed")


class GlobalUpdatedGoal(GoalUpdated):
    """Check whether ``goal`` or ``goals`` have changed since the last check; true at the first one."""

    AT_FIRST: ClassVar = True


class ArePosesNear(SkillCondition):
    """Check whether two poses are within ``tolerance`` metres of each other."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    ref_pose = In(Pose2D, "x;y;theta")
    target_pose = In(Pose2D, "x;y;theta")
    tolerance = In[float](Positive, "metres", default=0.5)

    def check(self) -> tuple[str, str] | None:
        """Compare the poses."""
        distance = self.ref_pose.distance_to(self.target_pose)
        return None if distance <= self.tolerance else ("not_near", f"{distance:.2f} m apart")


class RemovePassedGoals(InstantSkill):
    """Remove the leading poses of a list that the base is near to; the last pose always remains."""

    INPUT_PORTS: ClassVar = {**FRAMES, **without_meaning("input_waypoint_statuses")}
    OUTPUT_PORTS: ClassVar = nothing_written("output_waypoint_statuses")
    input_goals = In(Goals, "x;y;theta;x;y;theta, in driving order")
    radius = In[float](NonNegative, "distance within which a pose counts as passed, metres", default=0.5)
    output_goals = Out(Goals, "the remaining poses", required=True)

    def act(self) -> None:
        """Compare with the current base pose."""
        goals: Goals = self.input_goals
        pose, passed = self.skills.world.base.pose, 0
        while passed < len(goals) - 1 and pose.distance_to(goals[passed]) <= self.radius:
            passed += 1
        self.output_goals = Goals(goals[passed:])


class RemoveInCollisionGoals(InstantSkill):
    """Remove the poses of a list at which the base would touch a known or seen obstacle."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVICE, **OCCUPANCY, **without_meaning("input_waypoint_statuses")}
    OUTPUT_PORTS: ClassVar = nothing_written("output_waypoint_statuses")
    input_goals = In(Goals, "x;y;theta;x;y;theta")
    output_goals = Out(Goals, "the remaining poses", required=True)

    def act(self) -> None:
        """Check the costmap."""
        goals: Goals = self.input_goals
        free = _is_free(self, goals)
        self.output_goals = Goals(goal for goal, kept in zip(goals, free, strict=True) if kept)


class CheckPoseOccupancy(InstantSkill):
    """Check whether the base can stand at a pose without touching a known or seen obstacle."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVICE, **OCCUPANCY}
    pose = In(Pose2D, "x;y;theta in the map frame")
    FAILS: ClassVar = {"goal_blocked": "another pose"}

    def act(self) -> None:
        """Check the costmap."""
        pose: Pose2D = self.pose
        if not _is_free(self, (pose,))[0]:
            raise SkillFailure("goal_blocked", f"the base would touch something at ({pose.x:.2f}, {pose.y:.2f}) m")


def _is_free(node: RobotNode, poses: Sequence[Pose2D]) -> list[bool]:
    """Return at which poses the base touches nothing."""
    if not poses:
        return []
    rows = np.array([[pose.x, pose.y, pose.theta] for pose in poses])
    return [bool(clear) for clear in node.skills.seen_costmap().footprint_clearance(rows) > 0.0]


class GetNextFewGoals(InstantSkill):
    """Output the first poses of a list."""

    num_goals = In[int](Count, "largest number of poses")
    input_goals = In(Goals, "x;y;theta;x;y;theta, in driving order")
    output_goals = Out(Goals, "the first poses")
    FAILS: ClassVar = {"no_goals": "give a pose"}

    def act(self) -> None:
        """Keep the first goals of the list."""
        goals: Goals = self.input_goals
        if not goals:
            raise SkillFailure("no_goals", "there is no pose")
        self.output_goals = Goals(goals[: self.num_goals])


class AppendGoalPoseToGoals(InstantSkill):
    """Append a pose to a list."""

    goal_pose = In(Pose2D, "x;y;theta")
    input_goals = In(Goals, "x;y;theta;x;y;theta; missing: an empty list", required=False)
    output_goals = Out(Goals, "with it")

    def act(self) -> None:
        """Append the pose."""
        self.output_goals = Goals((*(self.input_goals or ()), self.goal_pose))


class GetCurrentPose(InstantSkill):
    """Output the believed pose of the base, in the map frame."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    current_pose = Out(Pose2D, "x;y;theta")

    def act(self) -> None:
        """Read the localisation."""
        self.current_pose = self.skills.world.base.pose


class CheckStopStatus(RobotNode, StatefulAction):
    """SUCCESS once the base has been at rest for ``duration_stopped``; RUNNING until then, FAILURE if it moves."""

    REQUIRES = ("base", "lidar")
    velocity_threshold = In[float](Positive, "m/s and rad/s", default=0.01)
    duration_stopped = In[int](NonNegativeInt, "milliseconds", default=1000)

    def on_start(self) -> int:
        """Start the timer."""
        self._since = self.clock.now()
        return self.on_running()

    def on_running(self) -> int:
        """Check the measured velocity."""
        velocity = self.skills.base.velocity()
        if max(math.hypot(velocity.vx, velocity.vy), abs(velocity.wz)) > self.velocity_threshold:
            return FAILURE
        return SUCCESS if self.clock.now() - self._since >= self.duration_stopped * 1e-3 else RUNNING

    def on_halted(self) -> None:
        """Do nothing: the check moves nothing."""


class DistanceTraveled(SkillCondition):
    """True once the base is ``distance`` metres from its position at the first check or the last success."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    distance = In[float](Positive, "metres, Euclidean distance", default=1.0)
    FAILS: ClassVar = {"not_travelled": "nothing is wrong"}

    def on_load(self) -> None:
        """Reset the start position."""
        self._from: Pose2D | None = None

    def halt(self) -> None:
        """Reset the start position."""
        self._from = None
        super().halt()

    def check(self) -> tuple[str, str] | None:
        """Compare the distance."""
        pose = self.skills.world.base.pose
        self._from = self._from or pose
        travelled = pose.distance_to(self._from)
        if travelled < self.distance:
            return "not_travelled", f"{travelled:.2f} m so far"
        self._from = pose
        return None


class TimeExpired(SkillCondition):
    """True once ``seconds`` have passed since the first check or the last success."""

    seconds = In[float](Positive, "seconds", default=1.0)
    FAILS: ClassVar = {"not_expired": "nothing is wrong"}

    def on_load(self) -> None:
        """Start with the timer stopped."""
        self._since: float | None = None

    def halt(self) -> None:
        """Stop the timer."""
        self._since = None
        super().halt()

    def check(self) -> tuple[str, str] | None:
        """Check the clock."""
        now = self.clock.now()
        self._since = now if self._since is None else self._since
        if now - self._since < self.seconds:
            return "not_expired", f"{now - self._since:.1f} s so far"
        self._since = now
        return None


class GoalUpdater(Decorator):
    """Pass a goal on to the child, or a newer one from ``goal_update``.

    ``goal_update`` and ``goals_update`` are entries, by default of the root, that external code writes:
    ``blackboard.set``, the control channel. As with Nav2's topics, an update older than the goal is ignored.
    """

    input_goal = In(Pose2D, "x;y;theta", required=False)
    input_goals = In(Goals, "x;y;theta;x;y;theta", required=False)
    goal_update = In(object, "x;y;theta", default="{@goal_update}")
    goals_update = In(object, "x;y;theta;x;y;theta", default="{@goals_update}")
    output_goal = Out(Pose2D, "the newer goal")
    output_goals = Out(Goals, "the newer goals")

    def on_tick(self) -> int:
        """Choose the goal, then tick the child."""
        for what in ("goal", "goals"):
            given, update = self.get_input(f"input_{what}"), self.get_input(f"{what}_update")
            is_newer = self._written(f"{what}_update") >= self._written(f"input_{what}")
            chosen = update if update is not None and is_newer else given
            if chosen is not None:
                self.set_output(f"output_{what}", chosen)
        return self.child.execute_tick()

    def _written(self, port: str) -> float:
        """Return when the entry that a port leads to was written, seconds; a literal counts as older
        than every entry.
        """
        default = self.INPUT_PORTS[port].default_value
        key = key_of(self.attributes.get(port, default), port)
        return -math.inf if key is None else self.board.slot(key).stamp


class SpeedController(WatchesGoals, RobotNode, Decorator):
    """Tick the child at a rate that grows with the base's speed; immediately at the start and when the goal changes.

    From ``min_speed`` to ``max_speed`` the rate changes from ``min_rate`` to ``max_rate``. RUNNING in between.
    """

    REQUIRES = ("base", "lidar")
    min_rate = In[float](Positive, "hertz, above 0", default=0.1)
    max_rate = In[float](Positive, "hertz", default=1.0)
    min_speed = In[float](NonNegative, "m/s", default=0.0)
    max_speed = In[float](Positive, "m/s", default=0.5)

    def on_load(self) -> None:
        """Start with the timer stopped; check the limits if all are literals. Raises ValueError."""
        self._since, self._period, self._due = 0.0, 0.0, True
        self._goals: tuple[Any, Any] = (None, None)
        if are_literals(self, "min_rate", "max_rate", "min_speed", "max_speed"):
            self._limits()

    def on_tick(self) -> int:
        """Tick the child if it is running or due."""
        now, goals = self.clock.now(), (self.goal, self.goals)
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
        """Return the rate, hertz, at which the base's speed requests a tick of the child."""
        low, high, slow, fast = self._limits()
        velocity = self.skills.base.velocity()
        share = (math.hypot(velocity.vx, velocity.vy) - slow) / (fast - slow)
        return float(low + min(max(share, 0.0), 1.0) * (high - low))

    def _limits(self) -> tuple[float, float, float, float]:
        low, high = self.min_rate, self.max_rate
        slow, fast = self.min_speed, self.max_speed
        if low > high:
            raise self.error(f"min_rate is {low} Hz and max_rate {high} Hz, but the minimum should not be greater")
        if slow >= fast:
            raise self.error(f"min_speed is {slow} m/s and max_speed {fast} m/s, but the minimum should be less")
        return low, high, slow, fast


class DistanceController(RobotNode, Decorator):
    """Tick the child at the start, and whenever the base has travelled ``distance`` metres; RUNNING in between."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    distance = In[float](Positive, "metres, Euclidean distance", default=1.0)

    def on_load(self) -> None:
        """Reset the position."""
        self._from, self._due = Pose2D(), True

    def on_tick(self) -> int:
        """Tick the child if it is running or due."""
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
    """Tick the child if a new path close to the goal is much longer than the previous one; else SUCCESS.

    This indicates a blocked approach: waiting may be better than a long detour.
    """

    path_ = In(Path2D, "the path, replanned repeatedly", required=False, port="path")
    prox_len = In[float](Positive, "distance that counts as close, metres", default=3.0)
    length_factor = In[float](Positive, "ratio that counts as longer", default=2.0)

    def on_load(self) -> None:
        """Reset the path."""
        self._before: Path2D | None = None

    def halt(self) -> None:
        """Forget the path."""
        self._before = None
        super().halt()

    def on_tick(self) -> int:
        """Compare the path with the previous one."""
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
        """Return whether ``path`` leads to the same goal as the one before, and that one was short and this one is
        not.
        """
        before = self._before
        if path is None or before is None or path is before or path.goal != before.goal:
            return False
        short = before.length < self.prox_len
        return bool(short and path.length > self.length_factor * before.length)
