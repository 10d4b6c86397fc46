"""Watches a plan while it is carried out: what it still needs, compared with what is believed."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from bestman_bt.task_planning.builders.regression import Kernel, staircase
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
    """Knows what of a plan leads to the goal from a state, whatever has been done so far."""

    def __init__(self, plan: TaskPlan, goal: Iterable[Literal], most_ways: int = 8) -> None:
        self._goal = frozenset(goal)
        self._steps = staircase(steps_one_by_one(plan), self._goal, most_ways)

    def outlook(self, state: Collection[Fact]) -> Outlook:
        """Where the plan stands in a state."""
        if not _broken(self._goal, state):
            return Outlook(True, None)
        ready = [each.step for each in self._steps if each.holds_in(state)]
        if ready:
            return Outlook(False, ready[-1].actions[0])
        ways = [self._goal, *(way for each in self._steps for way in each.ways)]
        return Outlook(False, None, min((_broken(way, state) for way in ways), key=len))


def _broken(way: Kernel, state: Collection[Fact]) -> tuple[Literal, ...]:
    return tuple(sorted(literal for literal in way if not literal.holds_in(state)))
