"""Problems as PDDL 2.1: typed, with negative and quantified conditions and action costs."""

from __future__ import annotations

import re
from collections.abc import Iterable

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Action,
    Condition,
    Fact,
    Forall,
    Literal,
    Operator,
    Problem,
)

RENAMED = {"object": "item"}
"""PDDL's ``object`` is the type of everything."""


class PddlText:
    """A problem as a ``domain`` and a ``problem`` file.

    PDDL knows neither slashes nor upper case nor things of two types: a drawer is written as two objects, as a place
    and as a container; ``action`` finds the way back.
    """

    def __init__(self, problem: Problem, name: str = "bestman") -> None:
        self._problem = problem
        self._name = _word(name)
        self._signatures = signatures(problem)
        self._types = sorted(
            {kind for operator in problem.operators for kind in operator.parameters.values()}
            | {kind for types in self._signatures.values() for kind in types}
        )
        named = [(kind, name) for kind in self._types for name in problem.of_type(kind)]
        self._objects = {(kind, name): self._object(kind, name) for kind, name in named}
        self._operators = {_word(operator.name): operator for operator in problem.operators}

    def domain(self) -> str:
        """The domain file."""
        lines = [
            f"(define (domain {self._name})",
            "  (:requirements :strips :typing :negative-preconditions :equality :universal-preconditions "
            ":conditional-effects :action-costs)",
            f"  (:types {' '.join(map(_type, self._types))})",
            "  (:predicates",
            *(f"    ({_word(name)}{_typed(types)})" for name, types in sorted(self._signatures.items())),
            "  )",
            "  (:functions (total-cost) - number)",
        ]
        for operator in self._problem.operators:
            lines += self._action(operator)
        return "\n".join([*lines, ")"]) + "\n"

    def problem(self) -> str:
        """The problem file."""
        objects = [f"    {name} - {_type(kind)}" for (kind, _), name in self._objects.items()]
        state = [f"    {self._fact(fact)}" for fact in sorted(self._problem.state)]
        goal = " ".join(self._condition(literal) for literal in self._problem.goal)
        return "\n".join([
            f"(define (problem {self._name}_problem)",
            f"  (:domain {self._name})",
            *("  (:objects", *objects, "  )"),
            *("  (:init", *state, "    (= (total-cost) 0)", "  )"),
            f"  (:goal (and {goal}))",
            "  (:metric minimize (total-cost))",
            ")",
        ]) + "\n"  # fmt: skip

    def written(self, action: Action) -> tuple[str, tuple[str, ...]]:
        """Name and arguments of an action as the files have them."""
        kinds = action.operator.parameters.values()
        names = (self._objects[key] for key in zip(kinds, action.arguments, strict=True))
        return _word(action.name), tuple(names)

    def action(self, name: str, arguments: Iterable[str]) -> tuple[Operator, tuple[str, ...]]:
        """Which operator, and which things of the problem, are meant by names of the files."""
        operator = self._operators[name.lower()]
        meant = {written: own for (_, own), written in self._objects.items()}
        return operator, tuple(meant[argument.lower()] for argument in arguments)

    def _object(self, kind: str, name: str) -> str:
        other = [one for one in self._types if one != kind and self._problem.is_a(name, one)]
        return f"{_word(name)}__{_type(kind)}" if other else _word(name)

    def _action(self, operator: Operator) -> list[str]:
        parameters = " ".join(f"?{_word(name)} - {_type(kind)}" for name, kind in operator.parameters.items())
        pre = " ".join(map(self._condition, (*operator.pre, *operator.hold)))
        effects = " ".join(map(self._condition, operator.effects))
        return [
            f"  (:action {_word(operator.name)}",
            f"    :parameters ({parameters})",
            f"    :precondition (and {pre})",
            f"    :effect (and {effects} (increase (total-cost) {operator.cost:g}))",
            "  )",
        ]

    def _condition(self, condition: Condition) -> str:
        if isinstance(condition, Literal):
            text = self._fact(condition.fact)
            return f"(not {text})" if condition.negated else text
        return self._forall(condition)

    def _forall(self, condition: Forall) -> str:
        inner = self._condition(condition.then)
        if condition.given is not None:
            inner = f"(imply {self._fact(condition.given)} {inner})"
        return f"(forall ({_variable(condition.variable)} - {_type(condition.type)}) {inner})"

    def _fact(self, fact: Fact) -> str:
        types = self._signatures.get(fact.predicate, ("",) * len(fact.arguments))
        words = [
            _variable(name) if name.startswith("{") else self._objects.get((kind, name), _word(name))
            for name, kind in zip(fact.arguments, types, strict=True)
        ]
        return f"({' '.join([_word(fact.predicate) if fact.predicate != EQUAL else EQUAL, *words])})"


def signatures(problem: Problem) -> dict[str, tuple[str, ...]]:
    """Predicate → types of its arguments: declared, or as operators, state and goal use it."""
    known = dict(problem.predicates)
    for operator in problem.operators:
        for condition in (*operator.pre, *operator.hold, *operator.effects):
            kinds = {f"{{{name}}}": kind for name, kind in operator.parameters.items()}
            facts = [condition.fact] if isinstance(condition, Literal) else [condition.then.fact]
            if isinstance(condition, Forall):
                kinds[condition.variable] = condition.type
                facts += [condition.given] if condition.given is not None else []
            for fact in facts:
                types = tuple(kinds.get(name) or problem.objects[name] for name in fact.arguments)
                known.setdefault(fact.predicate, types)
    for fact in sorted({*problem.state, *(literal.fact for literal in problem.goal)}):
        known.setdefault(fact.predicate, tuple(problem.objects[name] for name in fact.arguments))
    known.pop(EQUAL, None)
    return known


def _typed(types: Iterable[str]) -> str:
    return "".join(f" ?x{number} - {_type(kind)}" for number, kind in enumerate(types))


def _variable(name: str) -> str:
    return f"?{_word(name[1:-1])}"


def _type(kind: str) -> str:
    return _word(RENAMED.get(kind, kind))


def _word(name: str) -> str:
    word = re.sub(r"[^a-z0-9_-]", "_", name.lower().replace("/", "__"))
    return word if word[:1].isalpha() else f"n{word}"
