"""The embedded planner: greedy search with helpful actions, then weighted A* for a cheaper plan, as in LAMA."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.symbolic.grounding import ground
from bestman_bt.task_planning.symbolic.problem import PlanningError, Problem, TaskPlan, Unsolvable
from bestman_bt.task_planning.symbolic.search import best_first, without_needless


@dataclass(frozen=True)
class SymbolicPlanner(TaskPlanner):
    """Plans for typed objects, negative conditions, ``forall`` over what never changes, and action costs.

    Richter and Westphal, "The LAMA planner", 2010: a greedy search finds a plan, weighted A* with ever smaller weights
    and the best cost as bound looks for cheaper ones.

    How long is searched, counted in states that are estimated: equal problems give equal plans.

    ``max_evaluations``: for a first plan; in a furnished kitchen these are 5 to 8 s of processor time. ``improvement``:
    for cheaper ones, with the ``weights`` of the estimate, one after the other.
    """

    max_evaluations: int = 10_000
    improvement: int = 300
    weights: tuple[float, ...] = (3.0, 1.0)

    def plan(self, problem: Problem) -> TaskPlan:
        """As ``TaskPlanner.plan``; PlanningError where the search ends before it knows."""
        grounded = ground(problem)
        found = best_first(grounded, math.inf, self.max_evaluations)
        if found.exhausted:
            unmet = problem.unmet_in(problem.state)
            raise Unsolvable(f"no order of actions leads to {' and '.join(map(str, unmet))}", unmet)
        if found.actions is None:
            limit = self.max_evaluations
            raise PlanningError(
                f"no plan among the first {limit} states, and no proof that there is none; ask for less"
            )
        best = without_needless(grounded, found.actions)
        for weight in self.weights:
            cost = sum(grounded.actions[number].cost for number in best)
            found = best_first(grounded, weight, self.improvement, bound=cost)
            if found.actions is not None:
                best = without_needless(grounded, found.actions)
        return TaskPlan(tuple(grounded.actions[number] for number in best))
