"""What makes a tree of a plan."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable

from bestman_bt.engine import XmlElement
from bestman_bt.task_planning.builders.plan_tree import PlanTree, Writer
from bestman_bt.task_planning.symbolic import Literal, TaskPlan


class TreeBuilder(ABC):
    """Makes a tree of a plan; where the goal holds already, one that succeeds at once."""

    def build(self, plan: TaskPlan, goal: Iterable[Literal], leaves: Collection[str] = ()) -> PlanTree:
        """``goal``: all that the plan is for. ``leaves``: abilities that are leaves, not subtrees.

        Raises PlanningError where the actions do not fit together.
        """
        goal, writer = tuple(goal), Writer(leaves)
        element = self.root(plan, goal, writer) if plan.actions else writer.holds("goal", goal)
        return PlanTree(plan, element)

    @abstractmethod
    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """The root of the tree; ``plan`` has actions."""
