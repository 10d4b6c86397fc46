"""Explains why no plan exists: chains from the goal back to facts that are unreachable under the delete
relaxation."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator

from bestman_bt.facts.holding import HOLDING
from bestman_bt.facts.located import LOCATED, UNSEEN
from bestman_bt.facts.on import ON
from bestman_bt.task_planning.symbolic.grounding import instantiate, reachable_actions
from bestman_bt.task_planning.symbolic.problem import Action, Fact, Literal, Operator, PlanningProblem

_Way = tuple[tuple[Literal, Action], ...]
"""The chain from the goal down: each needed fact, and the action that needs it."""


def explain(problem: PlanningProblem) -> str:
    """Return why a goal cannot be reached, as text: ``locked(fridge) is believed, and nothing changes that: …``.

    Each line is one root cause, with its chain to the goal. Empty if the goal holds already, and for problems with
    formulas or conditional effects.
    """
    unmet = problem.unmet_in(problem.state)
    literals = [goal for goal in unmet if isinstance(goal, Literal)]
    if len(literals) < len(unmet) or any(operator.formulas or operator.when for operator in problem.operators):
        return ""
    frontier = _Frontier(problem)
    lines = [line for goal in literals for line in frontier.lines(goal)]
    if not lines and len(unmet) == 1:
        return f"nothing that {unmet[0]} needs is out of reach, but no order of actions achieves it"
    if not lines and unmet:
        wanted = " and ".join(map(str, unmet))
        return f"each part of the goal is within reach alone, but no order of actions achieves {wanted} together"
    return "\n".join(dict.fromkeys(lines))


class _Frontier:
    """The end of the relaxed problem, in which nothing is undone."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem
        self._achievers: dict[Literal, list[Action]] = defaultdict(list)
        actions = [action for operator in problem.operators for action in _instances(problem, operator)]
        for action in actions:
            for effect in action.effects:
                self._achievers[effect].append(action)
        _, self._reached = reachable_actions(actions, problem.state)

    def lines(self, goal: Literal) -> Iterator[str]:
        """Yield a line for each root cause of an unreachable goal."""
        for words, way in self._roots(goal, frozenset({goal}), (), {goal}):
            steps = "; ".join(f"{action} needs {need}" for need, action in reversed(way))
            yield f"{words}: {goal} is out of reach" + (f" ({steps})" if steps else "")

    def _roots(
        self, literal: Literal, above: frozenset[Literal], way: _Way, asked: set[Literal]
    ) -> Iterator[tuple[str, _Way]]:
        """Yield the first missing facts as text, with the chain to each.

        ``above``: from the goal down to ``literal``; ``asked``: facts that are explained already.
        """
        if self._within_reach(literal):
            return
        searches = self._searches(literal)
        if searches and not any(self._unseen(search) for search in searches):
            places = dict.fromkeys(search.arguments[1] for search in searches)
            yield f"the {literal.fact.arguments[0]} was not found at: {', '.join(places)}", way
            return
        actions = [search for search in searches if self._unseen(search)] or self._nearest(literal, above)
        if not actions:
            yield self._words(literal), way
        for action in actions:
            for need in self._missing(action):
                below = (*way, (need, action))
                if need in above:
                    yield f"{need} has to hold already before it can come about", below
                elif need not in asked:
                    asked.add(need)
                    yield from self._roots(need, above | {need}, below, asked)

    def _searches(self, literal: Literal) -> list[Action]:
        """Return the actions that might find a thing of unknown place, at each place."""
        if literal.negated or literal.fact.predicate not in (ON.name, HOLDING.name, LOCATED.name):
            return []
        located = Fact(LOCATED.name, literal.fact.arguments[:1])
        if located in self._problem.state:
            return []
        return [action for action in self._achievers[Literal(located)] if self._unseen_at(action) in action.pre]

    def _unseen(self, search: Action) -> bool:
        return self._unseen_at(search).holds_in(self._problem.state)

    @staticmethod
    def _unseen_at(search: Action) -> Literal:
        return Literal(Fact(UNSEEN.name, search.arguments[:2]))

    def _nearest(self, literal: Literal, above: frozenset[Literal]) -> list[Action]:
        """Return the action that achieves the literal with the fewest missing preconditions.

        Facts believed to be false count most (the key is in another drawer), then circular dependencies.
        """

        def rank(action: Action) -> tuple[int, bool, int, str]:
            missing = self._missing(action)
            return sum(map(self._otherwise, missing)), not above.isdisjoint(missing), len(missing), str(action)

        return sorted(self._achievers[literal], key=rank)[:1]

    def _otherwise(self, literal: Literal) -> bool:
        """Return whether another fact with this predicate is believed of the same thing."""
        predicate, arguments = literal.fact
        return len(arguments) > 1 and any(
            fact.predicate == predicate and fact.arguments[0] == arguments[0] for fact in self._problem.state
        )

    def _missing(self, action: Action) -> list[Literal]:
        return [need for need in sorted(action.pre) if not self._within_reach(need)]

    def _within_reach(self, literal: Literal) -> bool:
        return literal in self._reached or literal.holds_in(self._problem.state)

    def _words(self, root: Literal) -> str:
        if root.negated:
            return f"{root.fact} is believed, and nothing changes that"
        return f"{root} is not believed, and no action achieves it"


def _instances(problem: PlanningProblem, operator: Operator) -> Iterator[Action]:
    """Yield an operator for all things of its types, including impossible ones, to explain them."""
    for arguments in itertools.product(*(problem.of_type(kind) for kind in operator.parameters.values())):
        yield instantiate(problem, operator, arguments)
