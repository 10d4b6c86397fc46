"""How far the goal is if nothing were ever undone: h_add (Bonet and Geffner, 2001), h_ff on it (Hoffmann, 2001)."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

from bestman_bt.task_planning.symbolic.grounding import GroundProblem, bits_of


@dataclass(frozen=True)
class Estimate:
    """``cost``: of a relaxed plan, infinite where there is none; ``helpful``: the actions that it begins with."""

    cost: float
    helpful: frozenset[int] = frozenset()


class RelaxedPlan:
    """Estimates by relaxed plans: each fact is reached by the action that is cheapest with h_add.

    The actions that a relaxed plan begins with are the helpful ones.
    """

    def __init__(self, problem: GroundProblem) -> None:
        self._problem = problem
        self._costs = [action.cost for action in problem.actions]
        self._counts = [len(needs) for needs in problem.needs]
        self._free = [number for number, count in enumerate(self._counts) if count == 0]
        self._goal = bits_of(problem.goal)

    def estimate(self, state: int) -> Estimate:
        """For a state of the problem, in bits."""
        supporters = self._supporters(state)
        if supporters is None:
            return Estimate(math.inf)
        problem = self._problem
        used: set[int] = set()
        pending = [goal for goal in self._goal if not state >> goal & 1]
        marked = set(pending)
        while pending:
            action = supporters[pending.pop()]
            if action in used:
                continue
            used.add(action)
            for need in problem.needs[action]:
                if need not in marked and not state >> need & 1:
                    marked.add(need)
                    pending.append(need)
        first = frozenset(number for number in used if problem.pre[number] & ~state == 0)
        return Estimate(sum(self._costs[number] for number in used), first)

    def _supporters(self, state: int) -> list[int] | None:
        """For each literal the action that reaches it cheapest; None where a part of the goal is out of reach."""
        problem, counts, costs = self._problem, list(self._counts), list(self._costs)
        needed_by, gives = problem.needed_by, problem.gives
        reached = [math.inf] * len(problem.literals)
        supporter = [-1] * len(problem.literals)
        done = bytearray(len(problem.literals))
        queue: list[tuple[float, int]] = []
        for literal in bits_of(state):
            reached[literal] = 0.0
            queue.append((0.0, literal))

        def offer(action: int) -> None:
            cost = costs[action]
            for literal in gives[action]:
                if cost < reached[literal]:
                    reached[literal] = cost
                    supporter[literal] = action
                    heapq.heappush(queue, (cost, literal))

        for action in self._free:
            offer(action)
        missing = set(self._goal)
        while queue:
            cost, literal = heapq.heappop(queue)
            if done[literal]:
                continue
            done[literal] = 1
            missing.discard(literal)
            if not missing:
                return supporter
            for action in needed_by[literal]:
                costs[action] += cost
                counts[action] -= 1
                if counts[action] == 0:
                    offer(action)
        return None if missing else supporter
