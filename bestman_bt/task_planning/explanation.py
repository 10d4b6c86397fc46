"""Why there is no plan: from the goal back to what is missing, along what is out of reach even if nothing is undone."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator

from bestman_bt.task_planning.symbolic import (
    Action,
    Literal,
    Operator,
    Problem,
    instantiate,
    reachable_actions,
)


def explain(problem: Problem) -> str:
    """Why a goal cannot be reached, in words: ``locked(fridge) is believed, and nothing changes that: …``.

    Each line is one root of the trouble, with the way from the goal to it. Empty where the goal holds already.
    """
    frontier = _Frontier(problem)
    lines = [line for goal in problem.unmet_in(problem.state) for line in frontier.lines(goal)]
    if not lines and problem.unmet_in(problem.state):
        wanted = " and ".join(str(goal) for goal in problem.unmet_in(problem.state))
        return f"each part of the goal is within reach alone, but no order of actions brings about {wanted} together"
    return "\n".join(dict.fromkeys(lines))


class _Frontier:
    """Where the relaxed problem, in which nothing is undone, stops."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._achievers: dict[Literal, list[Action]] = defaultdict(list)
        actions = [action for operator in problem.operators for action in _instances(problem, operator)]
        for action in actions:
            for effect in action.effects:
                self._achievers[effect].append(action)
        _, self._reached = reachable_actions(actions, problem.state)

    def lines(self, goal: Literal) -> Iterator[str]:
        """A line for each root of why a goal is out of reach."""
        for root, way in self._roots(goal, ()):
            steps = "; ".join(f"{action} needs {need}" for need, action in reversed(way))
            yield f"{self._words(root)}: {goal} is out of reach" + (f" ({steps})" if steps else "")

    def _roots(
        self, literal: Literal, way: tuple[tuple[Literal, Action], ...]
    ) -> Iterator[tuple[Literal, tuple[tuple[Literal, Action], ...]]]:
        """What is missing first, and from there (need, the action that needs it) up to the goal."""
        if self._within_reach(literal):
            return
        action = self._nearest(literal, {need for need, _ in way} | {literal})
        if action is None:
            yield literal, way
            return
        for need in self._missing(action):
            yield from self._roots(need, (*way, (need, action)))

    def _nearest(self, literal: Literal, seen: set[Literal]) -> Action | None:
        """Of the actions that would bring it about, the one that lacks least; none that leads round in a circle."""
        ways = [action for action in self._achievers[literal] if not seen & set(self._missing(action))]
        return min(ways, key=lambda action: (len(self._missing(action)), str(action)), default=None)

    def _missing(self, action: Action) -> list[Literal]:
        return [need for need in sorted(action.pre) if not self._within_reach(need)]

    def _within_reach(self, literal: Literal) -> bool:
        return literal in self._reached or literal.holds_in(self._problem.state)

    def _words(self, root: Literal) -> str:
        if root.negated:
            return f"{root.fact} is believed, and nothing changes that"
        if self._achievers[root]:
            return f"{root} is not believed, and what brings it about needs it"
        return f"{root} is not believed, and nothing brings it about"


def _instances(problem: Problem, operator: Operator) -> Iterator[Action]:
    """An operator for all things of its types: with those that can never be done, for these are to be explained."""
    for arguments in itertools.product(*(problem.of_type(kind) for kind in operator.parameters.values())):
        yield instantiate(problem, operator, arguments)
