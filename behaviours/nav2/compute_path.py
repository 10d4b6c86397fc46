"""Planning a path, without driving it: ComputePathToPose and ComputePathThroughPoses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from behaviours.nav2.ports import SERVER, PlannerName
from behaviours.navigate import DRIVING_FAILS
from behaviours.skill import Skill, SkillFailure, Steps, StepsTo
from bestman_bt.engine import In, Out
from bestman_bt.messages import Goals, Path2D, Pose2D

if TYPE_CHECKING:
    from bestman_bt.navigation.global_planning import Costmap, GlobalPlanner, PlanningFailure

ALL_GOALS = -1
"""What ``last_reached_index`` is where the path leads through all poses."""


class _ComputePath(Skill):
    """A path that leads through poses; without one the output is cleared, so that nobody drives an old path."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVER}
    start = In(Pose2D, "x;y;theta instead of where the base is", required=False)
    planner_id = In[str](
        PlannerName, "a global planner, as grid_astar or file.py:Class; the configured one", default=""
    )
    path_ = Out[Path2D | None](Path2D, "the path; empty on failure", port="path")
    FAILS: ClassVar = DRIVING_FAILS

    def on_halted(self) -> None:
        """Clear the path, as nav2 does."""
        super().on_halted()
        self.path_ = None

    def _plan(self, start: Pose2D | None, goals: Sequence[Pose2D]) -> StepsTo[tuple[int, PlanningFailure | None]]:
        """Plan through ``goals`` and put the path out; how many of them it can get to, and what ended that."""
        from bestman_bt.navigation.path_pieces import joined

        skills = self.skills
        name = self.planner_id
        planner = skills.planners(name, self.folders) if name else skills.global_planning
        begin = skills.world.base.pose if start is None else start
        legs: list[Path2D]
        legs, failure = yield self.compute("global_planning", _legs, planner, begin, goals, skills.seen_costmap())
        path = joined(legs) if failure is None else None
        self.path_ = path
        if path is not None:
            self.feedback_message = f"{path.length:.1f} m"
        return len(legs), failure


class ComputePathToPose(_ComputePath):
    """Plan a path to a pose, past ``viapoints`` where there are any."""

    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    viapoints = In(Goals, "passed on the way: x;y;theta;x;y;theta", required=False)
    use_start = In(bool, "false: from where the base is, all the same", required=False)

    def execute(self) -> Steps:
        """Plan."""
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
    last_reached_index = Out(int, "-1: the path leads through all; else the last pose that can be got to")
    FAILS: ClassVar = {"no_goals": "give a pose"}

    def execute(self) -> Steps:
        """Plan."""
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
    """The paths from each pose to the next as far as there are any, and what ended that."""
    from bestman_bt.navigation.global_planning import PlanningFailure

    legs: list[Path2D] = []
    for goal in goals:
        planned = planner.plan(start, goal, costmap)
        if isinstance(planned, PlanningFailure):
            return legs, planned
        legs.append(planned)
        start = goal
    return legs, None
