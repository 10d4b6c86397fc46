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
    """``actions``: their numbers, None where none was found. ``exhausted``: for there is no plan, or none so cheap."""

    actions: tuple[int, ...] | None
    exhausted: bool = False


def best_first(problem: GroundProblem, weight: float, max_evaluations: int, bound: float = math.inf) -> Found:
    """Lazy best-first search with a second queue for helpful actions (Richter and Helmert, 2009).

    ``weight``: of the estimate against the cost so far; infinite: greedy. ``bound``: only plans that cost less.
    A state is estimated when it is taken, by then its parent's estimate has ordered it; reached cheaper, it is opened
    again.
    """
    relaxed = RelaxedPlan(problem)
    cheapest: dict[int, float] = {problem.initial: 0.0}
    came_by: dict[int, tuple[int, int]] = {}
    queues: list[list[tuple[float, int, int, float]]] = [[(0.0, 0, problem.initial, 0.0)], []]
    turns, pushed, nearest = [0, 0], 0, math.inf
    expanded: dict[int, float] = {}
    evaluations = 0
    while any(queues):
        chosen = min((number for number in (0, 1) if queues[number]), key=lambda number: (turns[number], -number))
        turns[chosen] += 1
        _, _, state, cost = heapq.heappop(queues[chosen])
        if cost > cheapest[state] or expanded.get(state, math.inf) <= cost:
            continue
        if problem.goal & ~state == 0:
            return Found(_path(came_by, problem.initial, state))
        if evaluations == max_evaluations:
            return Found(None)
        expanded[state] = cost
        evaluations += 1
        estimate = relaxed.estimate(state)
        if estimate.cost < nearest:
            nearest = estimate.cost
            turns[1] -= BOOST
        for action in estimate.applicable:
            reached = problem.after(state, action)
            total = cost + problem.actions[action].cost
            if total >= bound or total >= cheapest.get(reached, math.inf):
                continue
            cheapest[reached] = total
            came_by[reached] = (state, action)
            rank = estimate.cost if weight == math.inf else total + weight * estimate.cost
            pushed += 1
            for queue in queues if action in estimate.helpful else queues[:1]:
                heapq.heappush(queue, (rank, pushed, reached, total))
    return Found(None, exhausted=True)


def without_needless(problem: GroundProblem, actions: Sequence[int]) -> tuple[int, ...]:
    """The plan without actions whose effects nothing needs (action elimination: Nakhost and Müller, 2010)."""
    plan = list(actions)
    number = 0
    while number < len(plan):
        state, kept = problem.initial, []
        for place, action in enumerate(plan):
            if place != number and problem.pre[action] & ~state == 0:
                state = problem.after(state, action)
                kept.append(action)
        if problem.goal & ~state == 0:
            plan = kept
        else:
            number += 1
    return tuple(plan)


def _path(came_by: dict[int, tuple[int, int]], initial: int, state: int) -> tuple[int, ...]:
    actions = []
    while state != initial:
        state, action = came_by[state]
        actions.append(action)
    return tuple(reversed(actions))
