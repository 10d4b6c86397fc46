"""Nav2's selectors: which algorithm the leaves after them take, by a name that others may write meanwhile."""

from __future__ import annotations

from typing import Any, ClassVar

from py_trees.ports import PortInformation

from behaviours.skill import InstantSkill
from bestman_bt.engine import In


class _Selector(InstantSkill):
    """Names an algorithm: that of the root entry ``topic_name``, else the default."""

    OF: ClassVar = ""
    topic_name = In(str, "the root entry by which others choose; Nav2 has a topic", required=False)

    def __init_subclass__(cls, **options: Any) -> None:
        """Each has ports named after what it selects."""
        kind = cls.OF
        cls.INPUT_PORTS = {f"default_{kind}": PortInformation(str, False, "the one that is taken until then", "")}
        cls.OUTPUT_PORTS = {f"selected_{kind}": PortInformation(str, False, "its name")}
        super().__init_subclass__(**options)

    def act(self) -> None:
        """Look up the entry."""
        topic = self.topic_name or f"{self.OF}_selector"
        chosen = self.owner.blackboard.slot(topic).value or self.get_input(f"default_{self.OF}")
        self.feedback_message = f"{chosen}"
        self.set_output(f"selected_{self.OF}", str(chosen))


class PlannerSelector(_Selector):
    """Name the planner that ``planner_id`` of the leaves after it takes."""

    OF = "planner"


class ControllerSelector(_Selector):
    """Name the path follower that ``controller_id`` of the leaves after it takes."""

    OF = "controller"


class SmootherSelector(_Selector):
    """Name the smoother that ``smoother_id`` of the leaves after it takes."""

    OF = "smoother"


class GoalCheckerSelector(_Selector):
    """Name a goal checker; FollowPath takes the name, and has one way to arrive."""

    OF = "goal_checker"


class ProgressCheckerSelector(_Selector):
    """Name a progress checker; FollowPath takes the name, and has one way to see that it is stuck."""

    OF = "progress_checker"


class PathHandlerSelector(_Selector):
    """Name a path handler; FollowPath takes the name, and has one way to follow."""

    OF = "path_handler"
