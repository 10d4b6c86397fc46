"""Asking of goals, and keeping them up to date: GoalReached, GoalUpdated, GlobalUpdatedGoal, RemovePassedGoals, …"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from py_trees.ports import PortInformation

from behaviours.nav2.ports import FRAMES
from behaviours.navigate import At
from behaviours.skill import InstantSkill, SkillCondition
from bestman_bt.engine import Decorator, In, Out
from bestman_bt.engine.ports import key_of
from bestman_bt.messages import Goals, Pose2D
from bestman_bt.messages.bounds import NonNegative, Positive

WATCHED: dict[str, PortInformation] = {
    "goal": PortInformation(object, required=False, default_value="{goal}", description="what is watched"),
    "goals": PortInformation(object, required=False, default_value="{goals}", description="watched, too"),
}


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

    INPUT_PORTS: ClassVar = {**FRAMES}
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
