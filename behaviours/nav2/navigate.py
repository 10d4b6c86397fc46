"""Nav2's planning of paths, following of paths, both in one leaf, and the selectors of their algorithms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.computation import Until
from behaviours.nav2.ports import SERVER, FollowerName, Nav2Errors, PlannerName, nothing_written, without_meaning
from behaviours.navigation.navigate import DRIVING_FAILS, NavigateTo
from behaviours.skill import Declaration, InstantSkill, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import Goals, Path2D, Pose2D
from bestman_bt.world_model.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure
    from bestman_bt.navigation.global_planning.costmap import Costmap

ALL_GOALS = -1
"""Value of ``last_reached_index`` if the path leads through all poses."""


class _ComputePath(Nav2Errors, Skill):
    """A path through poses; on failure the output is cleared, so that no outdated path is driven."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVER}
    start = In(Pose2D, "x;y;theta, in place of the current base pose", required=False)
    planner_id = In[str](
        PlannerName, "a global planner, such as grid_astar or file.py:Class; by default the configured one", default=""
    )
    path_ = Out[Path2D | None](Path2D, "the path; empty on failure", port="path")
    FAILS: ClassVar = DRIVING_FAILS

    def on_halted(self) -> None:
        """Clear the path, as nav2 does."""
        super().on_halted()
        self.path_ = None

    def _plan(
        self, start: Pose2D | None, goals: Sequence[Pose2D]
    ) -> SkillCoroutine[tuple[int, PlanningFailure | None]]:
        """Plan through ``goals`` and put the path out; how many of them it can get to, and what ended that."""
        from bestman_bt.navigation.path_pieces import joined

        skills = self.skills
        name = self.planner_id
        planner = (skills.planners(name, self.folders) if name else None) or skills.global_planning
        begin = skills.world.base.pose if start is None else start
        legs: list[Path2D]
        legs, failure = yield self.compute("global_planning", _legs, planner, begin, goals, skills.seen_costmap())
        path = joined(legs) if failure is None else None
        self.path_ = path
        if path is not None:
            self.feedback_message = f"{path.length:.1f} m"
        return len(legs), failure


class ComputePathToPose(_ComputePath):
    """Plan a path to a pose, past ``viapoints``, if any."""

    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    viapoints = In(Goals, "poses to pass: x;y;theta;x;y;theta", required=False)
    use_start = In(bool, "false: start at the current base pose in any case", required=False)

    def execute(self) -> SkillCoroutine[None]:
        """Plan the path and write it to the port."""
        start: Pose2D | None = self.start
        use_start = self.use_start
        if use_start is not None and not use_start:
            start = None
        _, failure = yield from self._plan(start, [*(self.viapoints or ()), self.goal])
        if failure is not None:
            raise SkillFailure(failure.reason.value, failure.text)


class ComputePathThroughPoses(_ComputePath):
    """Plan a path through several poses."""

    goals = In(Goals, "x;y;theta;x;y;theta in the map frame, metres and radians")
    last_reached_index = Out(int, "-1: the path leads through all poses; else the last reachable pose")
    FAILS: ClassVar = {"no_goals": "give a pose"}

    def execute(self) -> SkillCoroutine[None]:
        """Plan the path and write it to the port."""
        goals: Goals = self.goals
        if not goals:
            self.path_ = None
            raise SkillFailure("no_goals", "there is no pose to plan to")
        reached, failure = yield from self._plan(self.start, goals)
        self.last_reached_index = ALL_GOALS if failure is None else reached - 1
        if failure is not None:
            raise SkillFailure(failure.reason.value, failure.text)


def _legs(
    planner: GlobalPlanner, start: Pose2D, goals: Sequence[Pose2D], costmap: Costmap
) -> tuple[list[Path2D], PlanningFailure | None]:
    """Return the paths from each pose to the next as far as there are any, and what ended that."""
    from bestman_bt.navigation.global_planning.base import PlanningFailure

    legs: list[Path2D] = []
    for goal in goals:
        planned = planner.plan(start, goal, costmap)
        if isinstance(planned, PlanningFailure):
            return legs, planned
        legs.append(planned)
        start = goal
    return legs, None


class FollowPath(Nav2Errors, Skill):
    """Drive along a path to its goal pose.

    If the port gets another path meanwhile, the base switches to it without stopping; if it is cleared, the base
    continues on the current path.
    """

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("goal_checker_id", "progress_checker_id", "path_handler_id")}
    OUTPUT_PORTS: ClassVar = nothing_written("tracking_feedback")
    path_ = In(Path2D, "the path, in the map frame", required=False, port="path")
    controller_id = In[str](
        FollowerName,
        "a local planner, such as pure_pursuit or file.py:Class; else the configured one",
        default="",
    )
    FAILS: ClassVar = {"no_path": "ComputePathToPose first"}

    def execute(self) -> SkillCoroutine[None]:
        """Follow the paths of the port until the last one has ended."""
        path: Path2D | None = self.path_
        if path is None:
            raise SkillFailure("no_path", "there is no path to follow")
        driving = self._follow(path)
        try:
            while True:
                yield Until(self._has_new, driving)
                if driving.done:
                    yield driving
                    return
                driving = self._follow(self.path_ or path)
        finally:
            driving.cancel()

    def _follow(self, path: Path2D) -> Motion[BasePose]:
        skills, controller = self.skills, self.controller_id
        self._path, self._controller = path, controller
        self.feedback_message = f"driving {path.length:.1f} m"
        follower = skills.followers(controller, self.folders) if controller else None
        return skills.base.follow(path, skills.known_costmap(), follower)

    def _has_new(self) -> bool:
        """Return whether the port has a path that is new, or has another follower."""
        path: Path2D | None = self.path_
        if path is None:
            return False
        before = self._path
        if path is before:
            return bool(self.controller_id != self._controller)
        return path.goal != before.goal or not np.array_equal(path.points, before.points)


class NavigateToPose(Nav2Errors, NavigateTo):
    """Drive to a pose in the map frame: plan a path, follow it, replan if it is blocked."""

    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("behavior_tree")}


class NavigateThroughPoses(Nav2Errors, NavigateTo):
    """Drive to several poses in the map frame in order, each as ``NavigateToPose`` does."""

    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("goal", "behavior_tree")}
    goals = In(Goals, "x;y;theta;x;y;theta in the map frame, metres and radians")
    FAILS: ClassVar = {"no_goals": "give a pose"}
    DECLARATION = Declaration()

    def execute(self) -> SkillCoroutine[None]:
        """Drive to each pose in order."""
        goals: Goals = self.goals
        if not goals:
            raise SkillFailure("no_goals", "there is no pose to drive to")
        for goal in goals:
            yield from self.drive_to(goal)


class _Selector(InstantSkill):
    """Names an algorithm: that of the root entry ``topic_name``, else the default."""

    OF: ClassVar = ""
    topic_name = In(str, "the root entry for external selection, in place of Nav2's topic", required=False)

    def __init_subclass__(cls, **options: Any) -> None:
        """Name the ports after the selected kind."""
        kind = cls.OF
        cls.INPUT_PORTS = {f"default_{kind}": PortInformation(str, False, "the default until then", "")}
        cls.OUTPUT_PORTS = {f"selected_{kind}": PortInformation(str, False, "its name")}
        super().__init_subclass__(**options)

    def act(self) -> None:
        """Look up the entry."""
        topic = self.topic_name or f"{self.OF}_selector"
        chosen = self.owner.blackboard.slot(topic).value or self.get_input(f"default_{self.OF}")
        self.feedback_message = f"{chosen}"
        self.set_output(f"selected_{self.OF}", str(chosen))


class PlannerSelector(_Selector):
    """Select the planner for ``planner_id`` of later leaves."""

    OF = "planner"


class ControllerSelector(_Selector):
    """Select the path follower for ``controller_id`` of later leaves."""

    OF = "controller"


class SmootherSelector(_Selector):
    """Select the smoother for ``smoother_id`` of later leaves."""

    OF = "smoother"


class GoalCheckerSelector(_Selector):
    """Select a goal checker; FollowPath accepts the name, but has only one."""

    OF = "goal_checker"


class ProgressCheckerSelector(_Selector):
    """Select a progress checker; FollowPath accepts the name, but has only one."""

    OF = "progress_checker"


class PathHandlerSelector(_Selector):
    """Select a path handler; FollowPath accepts the name, but has only one."""

    OF = "path_handler"
