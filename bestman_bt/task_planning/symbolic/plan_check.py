"""Preconditions and effects of an operator in a state, evaluated directly on its conditions.

Plan checks use this and not the grounding, so that they are independent of it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from bestman_bt.task_planning.symbolic.problem import (
    Condition,
    Fact,
    Forall,
    Formula,
    Literal,
    Operator,
    PlanningProblem,
)


def broken_in(
    problem: PlanningProblem, operator: Operator, arguments: Sequence[str], state: Collection[Fact]
) -> tuple[Formula, ...]:
    """Return the violated preconditions and hold-conditions in a state, sorted."""
    meant = _meant(operator, arguments)
    asked = _said((*operator.pre, *operator.hold), problem, meant, state)
    broken = sorted({literal for literal in asked if not literal.holds_in(state)})
    formulas = (formula.bound(meant) for formula in operator.formulas)
    return (*broken, *(formula for formula in formulas if not problem.holds(formula, state)))


def state_after(
    problem: PlanningProblem, operator: Operator, arguments: Sequence[str], state: Collection[Fact]
) -> frozenset[Fact]:
    """Return the state after an operator; a fact that is both deleted and added holds."""
    meant = _meant(operator, arguments)
    effects = set(_said(operator.effects, problem, meant, state))
    for one in operator.when:
        every = [meant]
        for variable, kind in one.variables.items():
            every = [{**inside, variable: name} for inside in every for name in problem.of_type(kind)]
        effects |= {one.effect.bound(inside) for inside in every if problem.holds(one.given.bound(inside), state)}
    undone = {effect.fact for effect in effects if effect.negated}
    return frozenset(set(state) - undone | {effect.fact for effect in effects if not effect.negated})


def _said(
    conditions: Iterable[Condition],
    problem: PlanningProblem,
    meant: Mapping[str, str],
    state: Collection[Fact],
) -> Iterator[Literal]:
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


def _meant(operator: Operator, arguments: Sequence[str]) -> dict[str, str]:
    return {f"{{{port}}}": name for port, name in zip(operator.parameters, arguments, strict=True)}
