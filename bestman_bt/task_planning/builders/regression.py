"""What must hold at each point of a plan for the rest of it to reach the goal.

R. E. Fikes, P. E. Hart, N. J. Nilsson, "Learning and Executing Generalized Robot Plans", Artificial Intelligence 3,
1972: the kernels of the triangle table, by which PLANEX chooses the last action that is ready.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from bestman_bt.task_planning.builders.steps import Step
from bestman_bt.task_planning.symbolic import Fact, Literal, PlanningError

Kernel = frozenset[Literal]
"""What must hold, all of it."""


def kernels(steps: Sequence[Step], goal: Iterable[Literal]) -> tuple[Kernel, ...]:
    """One kernel more than steps: with ``kernels[i]``, the steps from ``i`` on reach the goal; the last is the goal.

    Raises PlanningError where a step undoes what a later one, or the goal, needs.
    """
    found = [frozenset(goal)]
    for step in reversed(steps):
        found.append(kernel(step, found[-1]))
    return tuple(reversed(found))


def kernel(step: Step, after: Kernel) -> Kernel:
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


class Ready(NamedTuple):
    """A step, and when it leads to the goal: where any of ``ways`` holds."""

    step: Step
    ways: tuple[Kernel, ...]

    def holds_in(self, state: Collection[Fact]) -> bool:
        """Whether the step leads to the goal from a state."""
        return any(all(literal.holds_in(state) for literal in way) for way in self.ways)


def staircase(steps: Sequence[Step], goal: Iterable[Literal], most_ways: int) -> tuple[Ready, ...]:
    """When each step leads to the goal, where some of those after it may be left out. The last that is ready is best.

    After a step any later one may follow, or the goal be reached: who holds the mug need not care whether the drawer,
    which was to be shut later, is shut. Actions side by side are steps of their own, too, for when the others are done.
    ``most_ways``: of a step, those first that leave out the fewest. Raises PlanningError as ``kernels`` does.
    """
    kernels(steps, goal)  # what does not fit together is told
    table: list[dict[Kernel, int]] = [{frozenset(goal): 0}]  # way → how many steps it leaves out
    found: list[Ready] = []
    for step in reversed([part for whole in steps for part in (*whole.alone, whole)]):
        later = [way for follower in table for way in follower]
        ways: dict[Kernel, int] = {}
        for skipped, follower in enumerate(table):
            for after, left_out in follower.items():
                before = _before(step, after)
                if before is not None and not _covered(before, later):  # else a later one is ready, too
                    ways[before] = min(ways.get(before, skipped + left_out), skipped + left_out)
        ways = dict(sorted(_simplified(ways).items(), key=lambda way: (way[1], sorted(way[0])))[:most_ways])
        table.insert(0, ways)
        found.insert(0, Ready(step, tuple(ways)))
    return tuple(found)


def _before(step: Step, after: Kernel) -> Kernel | None:
    try:
        return kernel(step, after)
    except PlanningError:  # ``after`` cannot come next
        return None


def _covered(way: Kernel, others: Sequence[Kernel]) -> bool:
    """Whether one of the others holds wherever a way does: at once, or however a literal is (Shannon expansion)."""
    if any(other <= way for other in others):
        return True
    possible = [other for other in others if not any(~literal in way for literal in other)]
    asked = frozenset().union(*possible) - way
    undecided = min((literal for literal in asked if ~literal in asked), default=None)
    return undecided is not None and all(_covered(way | {one}, possible) for one in (undecided, ~undecided))


def _simplified(ways: Mapping[Kernel, int]) -> dict[Kernel, int]:
    """Two that differ in whether one literal holds are one without it; those that ask for more than others go."""
    found = dict(ways)
    while True:
        found = {way: left_out for way, left_out in found.items() if not any(other < way for other in found)}
        merged = {
            way - {literal}: min(left_out, found[way ^ {literal, ~literal}])
            for way, left_out in found.items()
            for literal in way
            if way ^ {literal, ~literal} in found
        }
        if not merged:
            return found
        found |= merged
