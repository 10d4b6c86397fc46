"""One action after the other, each of them only while the rest of the plan leads to the goal."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine import XmlElement
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import Writer
from bestman_bt.task_planning.builders.regression import kernels
from bestman_bt.task_planning.builders.steps import steps_one_by_one, steps_side_by_side
from bestman_bt.task_planning.symbolic.problem import Literal, TaskPlan


@dataclass(frozen=True)
class SequenceBuilder(TreeBuilder):
    """The plan as it stands; it fails with the first action that fails, or before one that would be in vain.

    Before each action it asks for its kernel: a pre-condition of a later one that broke is noticed at once, too.

    ``parallel``: whether independent actions of different parts go side by side.
    """

    parallel: bool = True

    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """Return a Sequence: is it ready, do it, and so on; at last, does the goal hold."""
        steps = steps_side_by_side(plan) if self.parallel else steps_one_by_one(plan)
        children: list[XmlElement] = []
        for number, (step, kernel) in enumerate(zip(steps, kernels(steps, goal), strict=False), 1):
            children += [writer.holds(f"{number}_is_ready", kernel), writer.step(number, step)]
        return writer.node("Sequence", "plan", [*children, writer.holds("goal", goal)])
