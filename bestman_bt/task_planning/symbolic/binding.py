"""From operators to actions: parameters bound to things of the world, ``forall`` written out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Condition,
    Fact,
    Literal,
    Operator,
    PlanningError,
    Problem,
)

EQUAL = "="
"""The predicate that holds of a thing and itself."""


def instantiate(problem: Problem, operator: Operator, arguments: Sequence[str]) -> Action:
    """The action of an operator for things of the problem; PlanningError where their number or a type is wrong."""
    if len(arguments) != len(operator.parameters):
        named = ", ".join(operator.parameters)
        raise PlanningError(f"{operator.name} takes ({named}), got ({', '.join(arguments)})")
    for (port, kind), name in zip(operator.parameters.items(), arguments, strict=True):
        if name not in problem.objects:
            raise PlanningError(f"{operator.name}: {port} is {name!r}, and nothing is called so")
        if not problem.is_a(name, kind):
            raise PlanningError(f"{operator.name}: {port} should be a {kind}, {name} is a {problem.objects[name]}")
    return bind(problem, operator, arguments)


def bind(problem: Problem, operator: Operator, arguments: Sequence[str]) -> Action:
    """As ``instantiate``, for arguments that fit."""
    values = {f"{{{name}}}": value for name, value in zip(operator.parameters, arguments, strict=True)}
    hold = frozenset(written_out(problem, operator.hold, values))
    pre = frozenset(written_out(problem, operator.pre, values)) | hold
    each = written_out(problem, operator.each, values)
    add = frozenset(fact.bound(values) for fact in operator.add) | {one.fact for one in each if not one.negated}
    delete = frozenset(fact.bound(values) for fact in operator.delete) | {one.fact for one in each if one.negated}
    unequal = frozenset(need for need in pre if need.fact.predicate != EQUAL or not _equal(need))
    return Action(operator, tuple(arguments), unequal, hold, add, delete - add)


def written_out(problem: Problem, conditions: Iterable[Condition], values: Mapping[str, str]) -> list[Literal]:
    """Conditions with ``values`` for parameters; ``forall`` becomes a literal for each thing with ``given``."""
    literals: list[Literal] = []
    for condition in conditions:
        if isinstance(condition, Literal):
            literals.append(condition.bound(values))
            continue
        bound = condition.bound(values)
        for name in problem.of_type(condition.type):
            each = bound.bound({condition.variable: name})
            if each.given is None or each.given in problem.state:
                literals.append(each.then)
    return literals


def holds(literal: Literal, state: frozenset[Fact]) -> bool:
    """Whether a literal holds in a state; equality is no fact of it."""
    return _equal(literal) if literal.fact.predicate == EQUAL else literal.holds_in(state)


def _equal(literal: Literal) -> bool:
    first, second = literal.fact.arguments
    return (first == second) != literal.negated
