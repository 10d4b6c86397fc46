"""Writer of PDDL 2.1: ``:adl`` and action costs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    ROOT,
    Action,
    Condition,
    Fact,
    Forall,
    Formula,
    Joined,
    Literal,
    Operator,
    PlanningProblem,
    Quantified,
    When,
)

Key = TypeVar("Key")

RENAMED = {ROOT: "item"}
"""PDDL's ``object`` is the type of everything; here a thing often has several types."""


class PddlText:
    """A problem as a ``domain`` and a ``problem`` file.

    PDDL has no slashes, upper case letters or types with two supertypes: a drawer that is a place and a container is
    written as two objects, and equal lower-case names get numbers; ``action`` converts names back.
    """

    def __init__(self, problem: PlanningProblem, name: str = "bestman") -> None:
        self._problem = problem
        self._name = _word(name)
        self._signatures = signatures(problem)
        types = {kind for operator in problem.operators for kind in operator.parameters.values()}
        types.update(*self._signatures.values(), *(around.values() for _, around in _stated_facts(problem)))
        self._is_tree = all(len(above) == 1 for above in problem.supertypes.values())
        if self._is_tree:
            types.update(problem.objects.values(), problem.supertypes, *problem.supertypes.values())
        self._types = sorted(types)
        of_object = all(problem.is_a(name, ROOT) for name in problem.objects)
        renamed = {} if self._is_tree and of_object else RENAMED
        self._kinds = _apart({kind: _word(renamed.get(kind, kind)) for kind in self._types})
        words = _apart({name: _word(name) for name in problem.objects})
        named = {(kind, name): words[name] for kind in self._types for name in problem.of_type(kind)}
        self._objects = named if self._is_tree else _apart({key: self._object(*key) for key in named})
        used = {name for fact, _ in _operator_facts(problem) for name in fact.arguments if not name.startswith("{")}
        self._constants = {key for key in named if key[1] in used}
        self._predicates = _apart({name: _word(name) for name in sorted(self._signatures)})
        self._names = _apart({operator.name: _word(operator.name) for operator in problem.operators})
        self._operators = {self._names[operator.name]: operator for operator in problem.operators}

    def domain(self) -> str:
        """Return the domain file."""
        constants = self._declared_objects(constant=True)
        lines = [
            f"(define (domain {self._name})",
            "  (:requirements :adl :action-costs)",
            f"  (:types {' '.join(self._declared_types())})",
            *(("  (:constants", *constants, "  )") if constants else ()),
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
        state = [f"    {self._fact(fact)}" for fact in sorted(self._problem.state)]
        goal = " ".join(map(self._formula, self._problem.goal))
        return "\n".join([
            f"(define (problem {self._name}_problem)",
            f"  (:domain {self._name})",
            *("  (:objects", *self._declared_objects(constant=False), "  )"),
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

    def _declared_types(self) -> list[str]:
        """Return each type, those with a supertype first, since PDDL's dash is for all types before it."""
        above = self._problem.supertypes if self._is_tree else {}
        below = [f"{self._kinds[kind]} - {self._kinds[above[kind][0]]}" for kind in self._types if kind in above]
        return [*below, *(self._kinds[kind] for kind in self._types if kind not in above and self._kinds[kind] != ROOT)]

    def _declared_objects(self, constant: bool) -> list[str]:
        """Return the lines of the objects that operators name, or of the others."""
        own = self._problem.objects
        return [
            f"    {word} - {self._kinds[kind]}"
            for (kind, name), word in self._objects.items()
            if ((kind, name) in self._constants) == constant and (not self._is_tree or own[name] == kind)
        ]

    def _object(self, kind: str, name: str) -> str:
        other = [one for one in self._types if one != kind and self._problem.is_a(name, one)]
        return f"{_word(name)}__{_type(kind)}" if other else _word(name)

    def _action(self, operator: Operator) -> list[str]:
        parameters = " ".join(f"?{_word(name)} - {self._kinds[kind]}" for name, kind in operator.parameters.items())
        conditions = (*map(self._condition, (*operator.pre, *operator.hold)), *map(self._formula, operator.formulas))
        pre = " ".join(conditions)
        effects = " ".join([*map(self._effect, operator.effects), *map(self._when, operator.when)])
        return [
            f"  (:action {self._names[operator.name]}",
            f"    :parameters ({parameters})",
            f"    :precondition (and {pre})",
            f"    :effect (and {effects} (increase (total-cost) {operator.cost:g}))",
            "  )",
        ]

    def _condition(self, condition: Condition, given: str = "imply") -> str:
        if isinstance(condition, Literal):
            return self._formula(condition)
        inner = self._formula(condition.then)
        if condition.given is not None:
            inner = f"({given} {self._fact(condition.given)} {inner})"
        return self._quantified("forall", {condition.variable: condition.type}, inner)

    def _effect(self, effect: Condition) -> str:
        return self._condition(effect, given="when")

    def _when(self, one: When) -> str:
        text = f"(when {self._formula(one.given)} {self._formula(one.effect)})"
        return self._quantified("forall", one.variables, text) if one.variables else text

    def _formula(self, formula: Formula) -> str:
        if isinstance(formula, Literal):
            text = self._fact(formula.fact)
            return f"(not {text})" if formula.negated else text
        if isinstance(formula, Joined):
            return f"({' '.join(['and' if formula.every else 'or', *map(self._formula, formula.parts)])})"
        word = "forall" if formula.every else "exists"
        return self._quantified(word, {formula.variable: formula.type}, self._formula(formula.body))

    def _quantified(self, word: str, variables: Mapping[str, str], inner: str) -> str:
        typed = (f"{_variable(name)} - {self._kinds.get(kind, _type(kind))}" for name, kind in variables.items())
        return f"({word} ({' '.join(typed)}) {inner})"

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
    for fact, around in (*_stated_facts(problem), *((fact, {}) for fact in sorted(problem.state))):
        known.setdefault(fact.predicate, tuple(around.get(name) or problem.objects[name] for name in fact.arguments))
    known.pop(EQUAL, None)
    return known


def _stated_facts(problem: PlanningProblem) -> Iterator[tuple[Fact, Mapping[str, str]]]:
    """Yield the facts of operators and goal with the types of the variables around them."""
    yield from _operator_facts(problem)
    for formula in problem.goal:
        yield from _typed_facts(formula, {})


def _operator_facts(problem: PlanningProblem) -> Iterator[tuple[Fact, Mapping[str, str]]]:
    """Yield the facts of all operators with the types of the variables around them."""
    for operator in problem.operators:
        kinds = {f"{{{name}}}": kind for name, kind in operator.parameters.items()}
        for condition in (*operator.pre, *operator.hold, *operator.effects, *operator.formulas):
            yield from _typed_facts(condition, kinds)
        for one in operator.when:
            yield from _typed_facts(Joined(True, (one.given, one.effect)), {**kinds, **one.variables})


def _typed_facts(condition: Condition | Formula, kinds: Mapping[str, str]) -> Iterator[tuple[Fact, Mapping[str, str]]]:
    """Yield the facts of a condition with the types of the variables around them."""
    match condition:
        case Literal():
            yield condition.fact, kinds
        case Joined():
            for part in condition.parts:
                yield from _typed_facts(part, kinds)
        case Quantified():
            yield from _typed_facts(condition.body, {**kinds, condition.variable: condition.type})
        case Forall():
            inside = {**kinds, condition.variable: condition.type}
            facts = (condition.then.fact, condition.given)
            yield from ((fact, inside) for fact in facts if fact is not None)


def _variable(name: str) -> str:
    return f"?{_word(name[1:-1])}"


def _apart(words: dict[Key, str]) -> dict[Key, str]:
    """Return the words, with a number appended to each that occurred before."""
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
