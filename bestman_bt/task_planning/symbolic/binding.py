"""From operators to actions: parameters bound to things of the world, ``forall`` written out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Action,
    Condition,
    Literal,
    Operator,
    PlanningError,
    Problem,
    with_article,
)


def instantiate(problem: Problem, operator: Operator, arguments: Sequence[str]) -> Action:
    """The action of an operator for things of the problem; PlanningError where their number or a type is wrong."""
    if len(arguments) != len(operator.parameters):
        named = ", ".join(operator.parameters)
        raise PlanningError(f"{operator.name} takes ({named}), got ({', '.join(arguments)})")
    for (port, kind), name in zip(operator.parameters.items(), arguments, strict=True):
        if name not in problem.objects:
            raise PlanningError(f"{operator.name}: {port} is {name!r}, and nothing is called so")
        if not problem.is_a(name, kind):
            kinds = with_article(kind), with_article(problem.objects[name])
            raise PlanningError(f"{operator.name}: {port} should be {kinds[0]}, {name} is {kinds[1]}")
    return bind(problem, operator, arguments)


def bind(problem: Problem, operator: Operator, arguments: Sequence[str]) -> Action:
    """As ``instantiate``, for arguments that fit."""
    values = {f"{{{name}}}": value for name, value in zip(operator.parameters, arguments, strict=True)}
    hold = frozenset(written_out(problem, operator.hold, values))
    pre = hold.union(written_out(problem, operator.pre, values))
    effects = written_out(problem, operator.effects, values)
    add = frozenset(one.fact for one in effects if not one.negated)
    delete = frozenset(one.fact for one in effects if one.negated) - add
    needed = frozenset(one for one in pre if one.fact.predicate != EQUAL or not one.holds_in(()))
    return Action(operator, tuple(arguments), needed, hold, add, delete)


def written_out(problem: Problem, conditions: Iterable[Condition], values: Mapping[str, str]) -> list[Literal]:
    """Conditions with ``values`` for parameters; ``forall`` becomes a literal for each thing with ``given``."""
    literals: list[Literal] = []
    for condition in conditions:
        bound = condition.bound(values)
        if isinstance(bound, Literal):
            literals.append(bound)
            continue
        for name in problem.of_type(bound.type):
            each = bound.bound({bound.variable: name})
            if each.given is None or each.given in problem.state:
                literals.append(each.then)
    return literals
