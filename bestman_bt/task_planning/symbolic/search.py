"""Searches over ground problems: greedy to find a plan at all, then less and less greedy to find a cheaper one."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.task_planning.symbolic.grounding import GroundProblem
from bestman_bt.task_planning.symbolic.heuristics import RelaxedPlan

BOOST = 1000
"""Turns that the queue of helpful actions gets ahead of the other one when it has led nearer to the goal."""


@dataclass(frozen=True)
class Found:
    """``actions``: their numbers, None where none was found; ``evaluations``: states that were estimated.

    ``exhausted``: nothing was left to search: there is no plan, or none below the bound.
    """

    actions: tuple[int, ...] | None
    evaluations: int
    exhausted: bool = False


def best_first(
    problem: GroundProblem, weight: float, max_evaluations: int, relaxed: RelaxedPlan, bound: float = math.inf
) -> Found:
    """Lazy best-first search with a second queue for helpful actions (Richter and Helmert, 2009).

    ``weight``: of the estimate against the cost so far; infinite: greedy. ``bound``: only plans that cost less.
    A state is estimated when it is taken, by then its parent's estimate has ordered it; reached cheaper, it is opened
    again.
    """
    successors = _Successors(problem)
    cheapest: dict[int, float] = {problem.initial: 0.0}
    came_by: dict[int, tuple[int, int]] = {}
    queues: list[list[tuple[float, int, int, float]]] = [[(0.0, 0, problem.initial, 0.0)], []]
    turns, pushed, evaluations, nearest = [0, 0], 0, 0, math.inf
    expanded: dict[int, float] = {}
    while any(queues):
        chosen = min((number for number in (0, 1) if queues[number]), key=lambda number: (turns[number], -number))
        turns[chosen] += 1
        _, _, state, cost = heapq.heappop(queues[chosen])
        if cost > cheapest[state] or expanded.get(state, math.inf) <= cost:
            continue
        if problem.goal & ~state == 0:
            return Found(_path(came_by, problem.initial, state), evaluations)
        if evaluations == max_evaluations:
            return Found(None, evaluations)
        expanded[state] = cost
        evaluations += 1
        estimate = relaxed.estimate(state)
        if estimate.cost == math.inf:
            continue
        if estimate.cost < nearest:
            nearest = estimate.cost
            turns[1] -= BOOST
        for action in successors.of(state):
            reached = state & ~problem.delete[action] | problem.add[action]
            total = cost + problem.actions[action].cost
            if total >= bound or total >= cheapest.get(reached, math.inf):
                continue
            cheapest[reached] = total
            came_by[reached] = (state, action)
            rank = estimate.cost if weight == math.inf else total + weight * estimate.cost
            pushed += 1
            heapq.heappush(queues[0], (rank, pushed, reached, total))
            if action in estimate.helpful:
                heapq.heappush(queues[1], (rank, pushed, reached, total))
    return Found(None, evaluations, exhausted=True)


def without_needless(problem: GroundProblem, actions: Sequence[int]) -> tuple[int, ...]:
    """The plan without actions whose effects nothing needs (action elimination: Nakhost and Müller, 2010)."""
    plan = list(actions)
    number = 0
    while number < len(plan):
        state, kept = problem.initial, []
        for place, action in enumerate(plan):
            if place != number and problem.pre[action] & ~state == 0:
                state = state & ~problem.delete[action] | problem.add[action]
                kept.append(action)
        if problem.goal & ~state == 0:
            plan = kept
        else:
            number += 1
    return tuple(plan)


class _Successors:
    """Which actions can be done in a state: those are looked at whose first need holds."""

    def __init__(self, problem: GroundProblem) -> None:
        self._problem = problem
        self._always = [number for number, needs in enumerate(problem.needs) if not needs]
        # The literal that the fewest actions need leaves the fewest to look at.
        users = problem.needed_by
        self._watched: dict[int, list[int]] = {}
        for number, needs in enumerate(problem.needs):
            if needs:
                rarest = min(needs, key=lambda literal: (len(users[literal]), literal))
                self._watched.setdefault(1 << rarest, []).append(number)

    def of(self, state: int) -> list[int]:
        pre = self._problem.pre
        found = list(self._always)
        for bit, actions in self._watched.items():
            if state & bit:
                found += [action for action in actions if pre[action] & ~state == 0]
        return sorted(found)


def _path(came_by: dict[int, tuple[int, int]], initial: int, state: int) -> tuple[int, ...]:
    actions = []
    while state != initial:
        state, action = came_by[state]
        actions.append(action)
    return tuple(reversed(actions))
