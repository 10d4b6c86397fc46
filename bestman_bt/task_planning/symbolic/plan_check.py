"""Preconditions and effects of an operator in a state, evaluated directly on its conditions.

Plan checks use this and not the grounding, so that they are independent of it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

from bestman_bt.task_planning.symbolic.problem import Condition, Fact, Forall, Literal, Operator, PlanningProblem


def broken_in(
    problem: PlanningProblem, operator: Operator, arguments: Sequence[str], state: Collection[Fact]
) -> tuple[Literal, ...]:
    """Return the violated preconditions and hold-conditions in a state, sorted."""
    asked = _said((*operator.pre, *operator.hold), problem, operator, arguments, state)
    return tuple(sorted({literal for literal in asked if not literal.holds_in(state)}))


def state_after(
    problem: PlanningProblem, operator: Operator, arguments: Sequence[str], state: Collection[Fact]
) -> frozenset[Fact]:
    """Return the state after an operator; a fact that is both deleted and added holds."""
    effects = set(_said(operator.effects, problem, operator, arguments, state))
    undone = {effect.fact for effect in effects if effect.negated}
    return frozenset(set(state) - undone | {effect.fact for effect in effects if not effect.negated})


def _said(
    conditions: Iterable[Condition],
    problem: PlanningProblem,
    operator: Operator,
    arguments: Sequence[str],
    state: Collection[Fact],
) -> Iterator[Literal]:
    meant = {f"{{{port}}}": name for port, name in zip(operator.parameters, arguments, strict=True)}
    for condition in conditions:
        if isinstance(condition, Forall):
            for name in problem.objects:
                if problem.is_a(name, condition.type):
                    inside = {**meant, condition.variable: name}
                    given = condition.given
                    if given is None or Literal(given.bound(inside)).holds_in(state):
                        yield condition.then.bound(inside)
        else:
            yield condition.bound(meant)
