"""What must hold at each point of a plan for the rest of it to reach the goal.

R. E. Fikes, P. E. Hart, N. J. Nilsson, "Learning and Executing Generalized Robot Plans", Artificial Intelligence 3,
1972: the kernels of the triangle table, by which PLANEX chooses the last action that is ready.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from bestman_bt.task_planning.builders.steps import Step
from bestman_bt.task_planning.symbolic import Fact, Literal, PlanningError


def kernels(steps: Sequence[Step], goal: Iterable[Literal]) -> tuple[frozenset[Literal], ...]:
    """One kernel more than steps: with ``kernels[i]``, the steps from ``i`` on reach the goal; the last is the goal.

    Raises PlanningError where a step undoes what a later one, or the goal, needs.
    """
    found = [frozenset(goal)]
    for step in reversed(steps):
        found.append(kernel(step, found[-1]))
    return tuple(reversed(found))


def kernel(step: Step, after: frozenset[Literal]) -> frozenset[Literal]:
    """What must hold before a step for ``after`` to hold after it. Raises PlanningError where nothing can."""
    effects = step.effects
    undone = sorted(literal for literal in after if ~literal in effects)
    if undone:
        raise PlanningError(f"{step} undoes {undone[0]}, which is needed after it")
    before = (after - effects) | step.pre
    for literal in sorted(before):
        if literal.negated and ~literal in before:
            raise PlanningError(f"before {step}, {literal} and the contrary would have to hold")
    return before


def next_step(table: Sequence[frozenset[Literal]], state: Collection[Fact]) -> int | None:
    """The last step that is ready: ``len(table) - 1`` where the goal holds, None where the plan does not help."""
    ready = (i for i in reversed(range(len(table))) if all(literal.holds_in(state) for literal in table[i]))
    return next(ready, None)
