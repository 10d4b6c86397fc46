"""Converts plans with disjunctions and conditional effects to plans without, from which trees are built."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from bestman_bt.task_planning.symbolic.grounding import ground_formula
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    Ground,
    Joined,
    Literal,
    PlanningError,
    PlanningProblem,
    TaskPlan,
)


def as_strips(problem: PlanningProblem, plan: TaskPlan) -> tuple[TaskPlan, tuple[Literal, ...]]:
    """Return a plan and its goal, both with literals only.

    Each action needs the literals due to which its formulas hold, and its conditional effects occur or do not occur, in
    the plan. A tree of it is correct, but does not continue in states in which these hold for other reasons.
    Raises PlanningError if an action cannot be done or the goal is not reached.
    """
    state, actions = problem.state, list[Action]()
    for action in plan.actions:
        if broken := action.broken_in(state):
            raise PlanningError(f"{action}: it needs {' and '.join(map(str, broken))}, which does not hold then")
        actions.append(_in_state(action, state))
        state = action.applied_to(state)
    if unmet := problem.unmet_in(state):
        raise PlanningError(f"after the plan {' and '.join(map(str, unmet))} does not hold")
    literals = [one for one in problem.goal if isinstance(one, Literal) and one.fact.predicate in problem.changing]
    others = Joined(True, tuple(one for one in problem.goal if not isinstance(one, Literal)))
    due_to = _reasons(ground_formula(problem, others) or Ground(), state)
    return TaskPlan(tuple(actions)), tuple(dict.fromkeys([*literals, *sorted(due_to)]))


def _in_state(action: Action, state: Collection[Fact]) -> Action:
    pre = action.pre | _reasons(Ground(action.any_of), state)
    effects = set(action.effects)
    for given, effect in action.when:
        occurs = all(part.holds_in(state) for part in given)
        pre |= _reasons(given, state) if occurs else _obstacles(given, state)
        effects |= {effect} if occurs else set()
    add = frozenset(effect.fact for effect in effects if not effect.negated)
    delete = frozenset(effect.fact for effect in effects if effect.negated) - add
    return replace(action, pre=pre, add=add, delete=delete, any_of=(), when=())


def _reasons(given: Ground, state: Collection[Fact]) -> frozenset[Literal]:
    """Return literals of the state from which all of ``given`` follows."""
    found = set[Literal]()
    for part in given:
        if isinstance(part, Literal):
            found.add(part)
        else:
            way = next(way for way in part.ways if all(one.holds_in(state) for one in way))
            found |= _reasons(way, state)
    return frozenset(found)


def _obstacles(given: Ground, state: Collection[Fact]) -> frozenset[Literal]:
    """Return literals of the state from which it follows that not all of ``given`` holds."""
    part = min((one for one in given if not one.holds_in(state)), key=str)
    if isinstance(part, Literal):
        return frozenset({~part})
    return frozenset[Literal]().union(*(_obstacles(way, state) for way in part.ways))
