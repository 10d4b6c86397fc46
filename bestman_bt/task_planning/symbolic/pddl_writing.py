"""Writer of PDDL 2.1: typed, with negative and quantified conditions and action costs."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TypeVar

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Action,
    Condition,
    Fact,
    Forall,
    Literal,
    Operator,
    PlanningProblem,
)

Key = TypeVar("Key")

RENAMED = {"object": "item"}
"""PDDL's ``object`` is the type of everything."""


class PddlText:
    """A problem as a ``domain`` and a ``problem`` file.

    PDDL has no slashes, upper case letters or things of two types: a drawer is written as two objects, as a place and
    as a container, and equal lower-case names get numbers; ``action`` converts names back.
    """

    def __init__(self, problem: PlanningProblem, name: str = "bestman") -> None:
        self._problem = problem
        self._name = _word(name)
        self._signatures = signatures(problem)
        self._types = sorted(
            {kind for operator in problem.operators for kind in operator.parameters.values()}
            | {kind for types in self._signatures.values() for kind in types}
        )
        named = [(kind, name) for kind in self._types for name in problem.of_type(kind)]
        self._objects = _apart({(kind, name): self._object(kind, name) for kind, name in named})
        self._kinds = _apart({kind: _word(RENAMED.get(kind, kind)) for kind in self._types})
        self._predicates = _apart({name: _word(name) for name in sorted(self._signatures)})
        self._names = _apart({operator.name: _word(operator.name) for operator in problem.operators})
        self._operators = {self._names[operator.name]: operator for operator in problem.operators}

    def domain(self) -> str:
        """Return the domain file."""
        lines = [
            f"(define (domain {self._name})",
            "  (:requirements :strips :typing :negative-preconditions :equality :universal-preconditions "
            ":conditional-effects :action-costs)",
            f"  (:types {' '.join(self._kinds.values())})",
            "  (:predicates",
            *(
                f"    ({self._predicates[name]}{self._typed(types)})"
                for name, types in sorted(self._signatures.items())
            ),
            "  )",
            "  (:functions (total-cost) - number)",
        ]
        for operator in self._problem.operators:
            lines += self._action(operator)
        return "\n".join([*lines, ")"]) + "\n"

    def problem(self) -> str:
        """Return the problem file."""
        objects = [f"    {name} - {self._kinds[kind]}" for (kind, _), name in self._objects.items()]
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
        """Return name and arguments of an action in the files."""
        kinds = action.operator.parameters.values()
        names = (self._objects[key] for key in zip(kinds, action.arguments, strict=True))
        return self._names[action.name], tuple(names)

    def action(self, name: str, arguments: Iterable[str]) -> tuple[Operator, tuple[str, ...]]:
        """Return operator and arguments for the names of an action in the files."""
        operator = self._operators[name.lower()]
        meant = {written: own for (_, own), written in self._objects.items()}
        return operator, tuple(meant[argument.lower()] for argument in arguments)

    def _object(self, kind: str, name: str) -> str:
        other = [one for one in self._types if one != kind and self._problem.is_a(name, one)]
        return f"{_word(name)}__{_type(kind)}" if other else _word(name)

    def _action(self, operator: Operator) -> list[str]:
        parameters = " ".join(f"?{_word(name)} - {self._kinds[kind]}" for name, kind in operator.parameters.items())
        pre = " ".join(map(self._condition, (*operator.pre, *operator.hold)))
        effects = " ".join(map(self._condition, operator.effects))
        return [
            f"  (:action {self._names[operator.name]}",
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
        kind = self._kinds.get(condition.type, _type(condition.type))
        return f"(forall ({_variable(condition.variable)} - {kind}) {inner})"

    def _typed(self, types: Iterable[str]) -> str:
        return "".join(f" ?x{number} - {self._kinds[kind]}" for number, kind in enumerate(types))

    def _fact(self, fact: Fact) -> str:
        types = self._signatures.get(fact.predicate, ("",) * len(fact.arguments))
        words = [
            _variable(name) if name.startswith("{") else self._objects.get((kind, name), _word(name))
            for name, kind in zip(fact.arguments, types, strict=True)
        ]
        return f"({' '.join([EQUAL if fact.predicate == EQUAL else self._predicates[fact.predicate], *words])})"


def signatures(problem: PlanningProblem) -> dict[str, tuple[str, ...]]:
    """Return predicate → types of its arguments: as declared, or as used by operators, state and goal."""
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


def _variable(name: str) -> str:
    return f"?{_word(name[1:-1])}"


def _apart(words: dict[Key, str]) -> dict[Key, str]:
    """Return the same with a number behind each word that another has already."""
    apart: dict[Key, str] = {}
    taken: set[str] = set()
    for key, word in words.items():
        number, own = 1, word
        while own in taken:
            number += 1
            own = f"{word}__{number}"
        taken.add(own)
        apart[key] = own
    return apart


def _type(kind: str) -> str:
    return _word(RENAMED.get(kind, kind))


def _word(name: str) -> str:
    word = re.sub(r"[^a-z0-9_-]", "_", name.lower().replace("/", "__"))
    return word if word[:1].isalpha() else f"n{word}"
