"""Search over ground problems: greedy for a first plan, then weighted A* for cheaper ones."""

from __future__ import annotations

import contextlib
import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.errors import MissingExtraError
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.symbolic.fast_downward import FastDownwardPlanner
from bestman_bt.task_planning.symbolic.grounding import GroundProblem, ground
from bestman_bt.task_planning.symbolic.problem import PlanningError, PlanningProblem, TaskPlan, Unsolvable


@dataclass(frozen=True)
class Estimate:
    """The estimate of a state. ``cost``: of a relaxed plan, infinite if there is none.

    ``applicable``: the applicable actions; ``helpful``: those of them in the relaxed plan.
    """

    cost: float
    applicable: tuple[int, ...] = ()
    helpful: frozenset[int] = frozenset()


NOTHING = 1e-6
"""Cost of a free action in estimates: its effects must cost more than literals that already hold."""


class RelaxedPlan:
    """Estimates the cost to the goal by relaxed plans, which ignore negative effects: the heuristic h_ff on h_add.

    Bonet and Geffner, "Planning as heuristic search", 2001; Hoffmann and Nebel, "The FF planning system", 2001.
    """

    def __init__(self, problem: GroundProblem) -> None:
        self._problem = problem
        self._costs = [0.0 if doer is None else max(problem.actions[doer].cost, NOTHING) for doer in problem.doers]
        self._counts = [len(needs) for needs in problem.needs]

    def estimate(self, state: int) -> Estimate:
        """Return the estimate of a state (bits) in which the goal does not hold."""
        supporter, applicable = self._explored(state)
        used = set[int]()
        pending = self._problem.numbers(self._problem.goal & ~state)
        while pending:
            rule = supporter[pending.pop()]
            if rule is None:
                return Estimate(math.inf)
            if rule not in used:
                used.add(rule)
                pending += (need for need in self._problem.needs[rule] if not state >> need & 1)
        doers = self._problem.doers
        cost = sum(self._costs[doer] for doer in {doers[rule] for rule in used} if doer is not None)
        helpful = frozenset(doer for rule in used & applicable if (doer := doers[rule]) is not None)
        return Estimate(cost, tuple(rule for rule in sorted(applicable) if rule < len(self._problem.actions)), helpful)

    def _explored(self, state: int) -> tuple[list[int | None], frozenset[int]]:
        """Return the rule that reaches each literal cheapest, and the rules of which all needs hold.

        Dijkstra's algorithm, until all of the goal is reached; what holds in the state costs nothing and comes first.
        """
        problem, counts, costs = self._problem, list(self._counts), list(self._costs)
        reached = [math.inf] * len(problem.literals)
        supporter: list[int | None] = [None] * len(problem.literals)
        queue: list[tuple[float, int]] = []
        for literal in problem.numbers(state):
            reached[literal] = 0.0
            queue.append((0.0, literal))
        applicable = [rule for rule, count in enumerate(counts) if count == 0]
        for rule in applicable:
            _offer(rule, costs[rule], problem.gives[rule], queue, reached, supporter)
        missing = set(problem.numbers(problem.goal))
        while queue and missing:
            cost, literal = heapq.heappop(queue)
            if cost > reached[literal]:
                continue
            missing.discard(literal)
            for rule in problem.needed_by[literal]:
                costs[rule] += cost
                counts[rule] -= 1
                if counts[rule] == 0:
                    _offer(rule, costs[rule], problem.gives[rule], queue, reached, supporter)
                    if cost == 0.0:
                        applicable.append(rule)
        return supporter, frozenset(applicable)


BOOST = 100
"""Number of turns by which the lists of helpful actions are preferred when the search has come nearer to the goal.

LAMA's 1,000 kept the search 10,000 states long in a local minimum of a VirtualHome problem that 35 states solve.
"""


class OpenLists:
    """Open lists that take turns (Richter and Helmert, 2009): two for each order of the states, of which the second has
    only the states that helpful actions lead to.
    """

    def __init__(self, orders: int) -> None:
        self._lists: list[list[tuple[tuple[float, ...], int, int, float]]] = [[] for _ in range(2 * orders)]
        self._turns = [0] * len(self._lists)
        self._pushed = 0

    def __bool__(self) -> bool:
        return any(self._lists)

    def push(self, ranks: Sequence[tuple[float, ...]], helpful: bool, state: int, cost: float) -> None:
        """Add a state and its cost; ``ranks``: one for each order. Of equal rank, the state added first comes first."""
        self._pushed += 1
        for number in range(0, len(self._lists), 1 if helpful else 2):
            heapq.heappush(self._lists[number], (ranks[number // 2], self._pushed, state, cost))

    def pop(self) -> tuple[int, float]:
        """Return the next state of the list whose turn it is, and its cost."""
        turns = [(turn, -number) for number, turn in enumerate(self._turns) if self._lists[number]]
        chosen = -min(turns)[1]
        self._turns[chosen] += 1
        _, _, state, cost = heapq.heappop(self._lists[chosen])
        return state, cost

    def prefer_helpful(self) -> None:
        """Let the lists of helpful actions have the next ``BOOST`` turns."""
        self._turns[1::2] = [turn - BOOST for turn in self._turns[1::2]]


@dataclass(frozen=True)
class Found:
    """The result of a search. ``actions``: numbers of the plan's actions, None if no plan was found. ``exhausted``:
    no plan exists within the bound."""

    actions: tuple[int, ...] | None
    exhausted: bool = False


def best_first(problem: GroundProblem, weight: float, max_evaluations: int, bound: float = math.inf) -> Found:
    """Run a lazy best-first search with preferred operators.

    ``weight``: of the estimate against the cost so far; infinite: greedy. ``bound``: upper bound of the cost. A state
    is evaluated when it is expanded, ordered by its parent's estimate; if reached at a lower cost, it is reopened. A
    greedy search orders states by the number of unmet goals, too, which leads across large plateaus of the estimate.
    """
    greedy = weight == math.inf
    relaxed = RelaxedPlan(problem)
    cheapest: dict[int, float] = {problem.initial: 0.0}
    came_by: dict[int, tuple[int, int]] = {}
    opened = OpenLists(2 if greedy else 1)
    opened.push([(0.0,)] * 2, False, problem.initial, 0.0)
    nearest, fewest = math.inf, len(problem.literals)
    expanded: dict[int, float] = {}
    evaluations = 0
    while opened:
        state, cost = opened.pop()
        if cost > cheapest[state] or expanded.get(state, math.inf) <= cost:
            continue
        unmet = (problem.goal & ~state).bit_count()
        if unmet == 0:
            return Found(_path(came_by, problem.initial, state))
        if evaluations == max_evaluations:
            return Found(None)
        expanded[state] = cost
        evaluations += 1
        estimate = relaxed.estimate(state)
        if estimate.cost < nearest or (greedy and unmet < fewest):
            opened.prefer_helpful()
        nearest, fewest = min(nearest, estimate.cost), min(fewest, unmet)
        for action in estimate.applicable:
            reached = problem.after(state, action)
            total = cost + problem.actions[action].cost
            if total >= bound or total >= cheapest.get(reached, math.inf):
                continue
            cheapest[reached] = total
            came_by[reached] = (state, action)
            ranks = [(estimate.cost,), ((problem.goal & ~reached).bit_count(), estimate.cost)]
            if not greedy:
                ranks = [(total + weight * estimate.cost,)]
            opened.push(ranks, action in estimate.helpful, reached, total)
    return Found(None, exhausted=True)


def without_unneeded_actions(problem: GroundProblem, actions: Sequence[int]) -> tuple[int, ...]:
    """Return the plan without unnecessary actions (action elimination: Nakhost and Müller, 2010)."""
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


@dataclass(frozen=True)
class SymbolicPlanner(TaskPlanner):
    """Plans for typed objects, conditions and effects of PDDL's ``:adl``, and action costs.

    Richter and Westphal, "The LAMA planner", 2010: a greedy search finds a plan, then weighted A* with decreasing
    weights and the best cost as bound searches for cheaper ones.

    The effort is counted in evaluated states, so that equal problems give equal plans. ``max_evaluations``: for the
    first plan; in a furnished kitchen these take 5 to 8 s of processor time. ``improvement``: for cheaper plans, with
    the ``weights`` of the estimate in turn. ``hand_over``: problems with more ground actions than this are passed to
    Fast Downward if the extra ``planning`` is installed; 0: never.
    """

    max_evaluations: int = 10_000
    improvement: int = 300
    weights: tuple[float, ...] = (3.0, 1.0)
    hand_over: int = 5_000

    def plan(self, problem: PlanningProblem) -> TaskPlan:
        """Return a plan. Raises Unsolvable, or PlanningError if the search limit is reached without a result."""
        grounded = ground(problem)
        if 0 < self.hand_over < len(grounded.actions):
            with contextlib.suppress(MissingExtraError):
                return FastDownwardPlanner().plan(problem)
        found = best_first(grounded, math.inf, self.max_evaluations)
        if found.exhausted:
            unmet = problem.unmet_in(problem.state)
            raise Unsolvable(f"no order of actions leads to {' and '.join(map(str, unmet))}", unmet)
        if found.actions is None:
            limit = self.max_evaluations
            raise PlanningError(
                f"no plan among the first {limit} states, and no proof that there is none; simplify the goal"
            )
        best = without_unneeded_actions(grounded, found.actions)
        for weight in self.weights:
            cost = sum(grounded.actions[number].cost for number in best)
            found = best_first(grounded, weight, self.improvement, bound=cost)
            if found.actions is not None:
                best = without_unneeded_actions(grounded, found.actions)
        return TaskPlan(tuple(grounded.actions[number] for number in best))


def _offer(
    rule: int,
    cost: float,
    gives: Sequence[int],
    queue: list[tuple[float, int]],
    reached: list[float],
    supporter: list[int | None],
) -> None:
    """Record the rule for each of the literals that it ``gives``, unless another rule reaches the literal at lower
    cost.
    """
    for literal in gives:
        if cost < reached[literal]:
            reached[literal], supporter[literal] = cost, rule
            heapq.heappush(queue, (cost, literal))
