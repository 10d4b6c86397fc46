"""Nav2's selectors: write the name of an algorithm for later leaves; external code may change it meanwhile."""

from __future__ import annotations

from typing import Any, ClassVar

from py_trees.ports import PortInformation

from behaviours.skill import InstantSkill
from bestman_bt.engine import In


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
