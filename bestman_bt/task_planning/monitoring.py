"""Watches a plan while it is carried out: what it still needs, compared with what is believed."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from bestman_bt.task_planning.builders.regression import kernels, next_step
from bestman_bt.task_planning.builders.steps import steps_one_by_one
from bestman_bt.task_planning.symbolic import Action, Fact, Literal, TaskPlan


@dataclass(frozen=True)
class Outlook:
    """How a plan stands: ``next``: the action to do, None where it is done or does not help any more.

    ``broken``: what the rest of the plan needs and is not believed, where it does not help.
    """

    done: bool
    next: Action | None
    broken: tuple[Literal, ...] = ()

    def __str__(self) -> str:
        if self.done:
            return "the goal holds"
        if self.next is not None:
            return f"next is {self.next}"
        return f"the plan does not help any more: it needs {' and '.join(map(str, self.broken))}"


class PlanMonitor:
    """Knows from the kernels of a plan where it stands in a state, whatever has been done so far."""

    def __init__(self, plan: TaskPlan, goal: Iterable[Literal]) -> None:
        self.plan = plan
        self._kernels = kernels(steps_one_by_one(plan), goal)

    def outlook(self, state: Collection[Fact]) -> Outlook:
        """Where the plan stands in a state."""
        ready = next_step(self._kernels, state)
        if ready is None:
            nearest = min(self._kernels, key=lambda kernel: len(self._broken(kernel, state)))
            return Outlook(False, None, self._broken(nearest, state))
        if ready == len(self.plan):
            return Outlook(True, None)
        return Outlook(False, self.plan.actions[ready])

    @staticmethod
    def _broken(kernel: frozenset[Literal], state: Collection[Fact]) -> tuple[Literal, ...]:
        return tuple(sorted(literal for literal in kernel if not literal.holds_in(state)))
