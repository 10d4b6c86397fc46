"""Sequential plan execution: each action starts only if the rest of the plan still reaches the goal."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine import XmlElement
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import Writer, parallel_steps, sequential_steps
from bestman_bt.task_planning.builders.regression import kernels
from bestman_bt.task_planning.symbolic.problem import Literal, TaskPlan


@dataclass(frozen=True)
class SequenceBuilder(TreeBuilder):
    """Executes the plan in order; fails with the first failing action, or before an action after which the goal is
    unreachable.

    Before each action it checks the kernel, so that a violated precondition of a later action is noticed immediately.
    ``parallel``: run independent actions of different parts in parallel.
    """

    parallel: bool = True

    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """Return a Sequence that alternates checks and actions, and finally checks the goal."""
        steps = parallel_steps(plan) if self.parallel else sequential_steps(plan)
        children: list[XmlElement] = []
        for number, (step, kernel) in enumerate(zip(steps, kernels(steps, goal), strict=False), 1):
            children += [writer.holds(f"{number}_is_ready", kernel), writer.step(number, step)]
        return writer.node("Sequence", "plan", [*children, writer.holds("goal", goal)])
