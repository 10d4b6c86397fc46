"""How far the goal is if nothing were ever undone: h_add (Bonet and Geffner, 2001), h_ff on it (Hoffmann, 2001)."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

from bestman_bt.task_planning.symbolic.grounding import GroundProblem


@dataclass(frozen=True)
class Estimate:
    """``cost``: of a relaxed plan, infinite where there is none.

    ``applicable``: the actions that can be done at once; ``helpful``: those of them that the relaxed plan has.
    """

    cost: float
    applicable: tuple[int, ...] = ()
    helpful: frozenset[int] = frozenset()


class RelaxedPlan:
    """Estimates by relaxed plans: each fact is reached by the action that is cheapest with h_add."""

    def __init__(self, problem: GroundProblem) -> None:
        self._problem = problem
        self._costs = [action.cost for action in problem.actions]
        self._counts = [len(needs) for needs in problem.needs]

    def estimate(self, state: int) -> Estimate:
        """For a state of the problem, in bits, in which the goal does not hold."""
        supporter, applicable = self._explored(state)
        used = set[int]()
        pending = self._problem.numbers(self._problem.goal & ~state)
        while pending:
            action = supporter[pending.pop()]
            if action is None:
                return Estimate(math.inf)
            if action not in used:
                used.add(action)
                pending += (need for need in self._problem.needs[action] if not state >> need & 1)
        cost = sum(self._costs[action] for action in used)
        return Estimate(cost, tuple(sorted(applicable)), applicable & used)

    def _explored(self, state: int) -> tuple[list[int | None], frozenset[int]]:
        """The action that reaches each literal cheapest, and the actions that can be done at once.

        Dijkstra's algorithm, until all of the goal is reached; what holds in the state costs nothing and comes first.
        """
        problem, counts, costs = self._problem, list(self._counts), list(self._costs)
        reached = [math.inf] * len(problem.literals)
        supporter: list[int | None] = [None] * len(problem.literals)
        queue: list[tuple[float, int]] = []

        def offer(action: int) -> None:
            cost = costs[action]
            for literal in problem.gives[action]:
                if cost < reached[literal]:
                    reached[literal], supporter[literal] = cost, action
                    heapq.heappush(queue, (cost, literal))

        for literal in problem.numbers(state):
            reached[literal] = 0.0
            queue.append((0.0, literal))
        applicable = [action for action, count in enumerate(counts) if count == 0]
        for action in applicable:
            offer(action)
        missing = set(problem.numbers(problem.goal))
        while queue and missing:
            cost, literal = heapq.heappop(queue)
            if cost > reached[literal]:
                continue
            missing.discard(literal)
            for action in problem.needed_by[literal]:
                costs[action] += cost
                counts[action] -= 1
                if counts[action] == 0:
                    offer(action)
                    if cost == 0.0:
                        applicable.append(action)
        return supporter, frozenset(applicable)
