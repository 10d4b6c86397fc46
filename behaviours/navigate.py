"""Navigating: where to stand, and how to get there."""

from __future__ import annotations

import math
from typing import ClassVar

from py_trees.ports import PortInformation

from behaviours.skill import Declaration, Skill, SkillCondition, SkillFailure, Steps
from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.navigation.global_planning import Costmap, PlanningFailure


class NavigateTo(Skill):
    """Drive to a pose in the map frame: plan a path, follow it, plan again where it is blocked."""

    INPUT_PORTS: ClassVar = {
        "goal": PortInformation(Pose2D, description="x;y;theta in the map frame, metres and radians"),
        "max_replans": PortInformation(int, required=False, default_value=2, description="new paths after a block"),
    }
    OUTPUT_PORTS: ClassVar = {"path": PortInformation(Path2D, required=False, description="the path that is driven")}
    DECLARATION = Declaration(effects=("at({goal})",))

    def execute(self) -> Steps:
        """Plan and follow."""
        skills = self.skills
        goal: Pose2D = self.get_input("goal")
        for attempt in range(self.get_input("max_replans") + 1):
            costmap = skills.costmap()
            path = yield self.compute("global_planning", self._plan, goal, costmap)
            if isinstance(path, PlanningFailure):
                raise SkillFailure(path.reason.value, path.text)
            self.set_output("path", path)
            self.feedback_message = f"driving {path.length:.1f} m"
            try:
                yield skills.base.follow(path, costmap)
            except SkillFailure as failure:
                if failure.code not in ("blocked", "tolerance") or attempt == self.get_input("max_replans"):
                    raise
            else:
                return

    def _plan(self, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        skills = self.skills
        return skills.algorithms.global_planning.plan(skills.world.base.pose, goal, costmap)


class At(SkillCondition):
    """Whether the base believes to be at a pose."""

    INPUT_PORTS: ClassVar = {
        "goal": PortInformation(Pose2D, description="x;y;theta in the map frame, metres and radians"),
        "tolerance": PortInformation(float, required=False, default_value=0.05, description="metres"),
        "heading_tolerance": PortInformation(float, required=False, default_value=0.1, description="radians"),
    }

    def check(self) -> tuple[str, str] | None:
        """Asks the localisation."""
        goal: Pose2D = self.get_input("goal")
        pose = self.skills.world.base.pose
        distance = pose.distance_to(goal)
        turn = abs(wrap_angle(pose.theta - goal.theta))
        if distance > self.get_input("tolerance") or turn > self.get_input("heading_tolerance"):
            return "not_at_goal", f"{distance:.2f} m and {math.degrees(turn):.0f}° from the goal"
        return None
