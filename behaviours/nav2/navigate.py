"""NavigateToPose and NavigateThroughPoses: planning and driving in one leaf."""

from __future__ import annotations

from typing import ClassVar

from behaviours.nav2.ports import SERVER, without_meaning
from behaviours.navigate import NavigateTo
from behaviours.skill import Declaration, SkillFailure, Steps
from bestman_bt.engine import In
from bestman_bt.messages import Goals


class NavigateToPose(NavigateTo):
    """Drive to a pose in the map frame: plan a path, follow it, plan again where it is blocked."""

    INPUT_PORTS: ClassVar = SERVER


class NavigateThroughPoses(NavigateTo):
    """Drive to several poses in the map frame, one after the other, as ``NavigateToPose`` does to each."""

    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("goal")}
    goals = In(Goals, "x;y;theta;x;y;theta in the map frame, metres and radians")
    FAILS: ClassVar = {"no_goals": "give a pose"}
    DECLARATION = Declaration()

    def execute(self) -> Steps:
        """Drive to each."""
        goals: Goals = self.goals
        if not goals:
            raise SkillFailure("no_goals", "there is no pose to drive to")
        for goal in goals:
            yield from self.drive_to(goal)
