"""The planning domain of the skills: abilities, predicates and things, as a planning problem."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from bestman_bt.engine import NodeRegistry
from bestman_bt.facts.on import ON
from bestman_bt.facts.predicate import Beliefs, Predicate
from bestman_bt.registry import suggestion
from bestman_bt.task_planning.abilities import Ability, DeclarationError, abilities_of
from bestman_bt.task_planning.state import SUPERTYPES, TYPES, known_predicates, read_state, things
from bestman_bt.task_planning.symbolic.facts import parse_conditions, parse_fact, parse_goal, parse_literals
from bestman_bt.task_planning.symbolic.grounding import written_out
from bestman_bt.task_planning.symbolic.problem import (
    Condition,
    Fact,
    Forall,
    GoalError,
    GoalFaults,
    Literal,
    Operator,
    PlanningProblem,
    with_article,
)

_LOG = logging.getLogger(__name__)
_NUMBER = re.compile(r"_\d+$")


@dataclass(frozen=True)
class Domain:
    """The ``abilities`` of planners and the declared ``predicates``; others hold once an ability has achieved them."""

    abilities: tuple[Ability, ...]
    predicates: Mapping[str, Predicate] = field(default_factory=known_predicates)

    def __post_init__(self) -> None:
        self._check_types()

    @classmethod
    def of(cls, registry: NodeRegistry) -> Domain:
        """Return the domain of the shipped abilities and a registry's leaves. Raises DeclarationError."""
        return cls(abilities_of(registry))

    @cached_property
    def operators(self) -> tuple[Operator, ...]:
        """The operators of the abilities, with abbreviations of facts expanded."""
        return tuple(self._written_out(ability.operator) for ability in self.abilities)

    @cached_property
    def signatures(self) -> dict[str, tuple[str, ...]]:
        """Return predicate → types of its arguments: as declared, or as the first ability uses it."""
        known = {name: predicate.types for name, predicate in self.predicates.items()}
        for ability in self.abilities:
            for fact, types in _uses(ability.operator):
                known.setdefault(fact.predicate, types)
        return known

    def _check_types(self) -> None:
        declared = {name: predicate.parameters for name, predicate in self.predicates.items()}
        declared |= {ability.name: ability.operator.parameters for ability in self.abilities}
        for name, parameters in declared.items():
            for parameter, kind in parameters.items():
                if kind not in TYPES:
                    raise DeclarationError(
                        f"{name}: {parameter} has the type {kind!r}; {suggestion(kind, list(TYPES))}"
                    )
        for ability in self.abilities:
            for fact, types in _uses(ability.operator):
                wanted = self.signatures[fact.predicate]
                if not _fit(types, wanted):
                    takes = ", ".join(wanted) or "no arguments"
                    raise DeclarationError(f"{ability.name}: {fact}: {fact.predicate} takes {takes}")

    def problem(self, beliefs: Beliefs, goal: str | None = None, instruction: str = "") -> PlanningProblem:
        """Return the planning problem of the beliefs and a goal. Raises GoalError for an invalid goal.

        ``goal``: facts as text, such as ``on(mug, table) and closed(drawer_chest/drawer_3)``; None: no goal yet.
        """
        objects = things(beliefs.world)
        problem = PlanningProblem(
            objects,
            read_state(beliefs, objects),
            (),
            self.operators,
            SUPERTYPES,
            {name: types for name, types in self.signatures.items() if not self._is_short(name)},
            instruction,
        )
        return problem if goal is None else self.with_goal(problem, goal)

    def with_goal(self, problem: PlanningProblem, goal: str) -> PlanningProblem:
        """Return the problem with a checked goal. Raises GoalError listing every fault, with the closest names."""
        literals: list[Literal] = []
        wrong = GoalFaults()
        for condition in parse_goal(goal):
            with wrong.step():
                resolved = Literal(self._resolved(problem, condition.fact), condition.negated)
                meant = written_out(problem, [self._meaning(resolved)], {})
                if not meant:
                    raise GoalError(f"{resolved} always holds; omit it")
                literals += meant
                literals += self._presumed(resolved)
        wrong.raise_if_any()
        self.refuse_contradictions(literals)
        return replace(problem, goal=tuple(dict.fromkeys(literals)))

    def given_places(self, problem: PlanningProblem, facts: Iterable[str]) -> dict[str, str]:
        """Return object → place, from given facts about unseen objects.

        Raises GoalError for facts other than ``on``.
        """
        given: dict[str, str] = {}
        wrong, literals = GoalFaults(), list[Literal]()
        for text in facts:
            with wrong.step():
                literals += parse_literals(text)
        for literal in literals:
            with wrong.step():
                fact = self._resolved(problem, literal.fact)
                if literal.negated or fact.predicate != ON.name:
                    raise GoalError(f"{literal} cannot be given; on(OBJECT, PLACE) can")
                name, place = fact.arguments
                if given.setdefault(name, place) != place:
                    raise GoalError(f"on({name}, {given[name]}) and on({name}, {place}) cannot both be given")
        wrong.raise_if_any()
        return given

    def _presumed(self, literal: Literal) -> list[Literal]:
        """Return the facts that a negation presupposes. Raises GoalError for a predicate that cannot be a goal."""
        predicate = self.predicates.get(literal.fact.predicate)
        if predicate is None or not literal.negated:
            return []
        if not predicate.negatable:
            raise GoalError(f"{literal}: {predicate.name} cannot be negated; a robot cannot lose knowledge")
        if not predicate.known_if:
            return []
        return [Literal(parse_fact(predicate.known_if).bound(_values(predicate, literal.fact.arguments)))]

    def refuse_contradictions(self, goal: Collection[Literal]) -> None:
        """Raise GoalError for a goal whose parts exclude each other according to the predicates."""
        wanted = [literal.fact for literal in goal if not literal.negated]
        clashes = [(str(fact), f"not {fact}") for fact in wanted if Literal(fact, negated=True) in goal]
        clashes += [(str(fact), str(other)) for fact in wanted for other in wanted if self._rules_out(fact, other)]
        if clashes:
            raise GoalError("the goal contradicts itself: {} and {} cannot hold together".format(*clashes[0]))

    def _rules_out(self, fact: Fact, other: Fact) -> bool:
        """Return whether two facts exclude each other according to the first one's predicate."""
        predicate = self.predicates.get(fact.predicate)
        if predicate is None or fact == other:
            return False
        values = _values(predicate, fact.arguments)
        patterns = [parse_fact(text).bound(values) for text in predicate.excludes]
        return any(
            pattern.predicate == other.predicate
            and all(asked in ("_", given) for asked, given in zip(pattern.arguments, other.arguments, strict=True))
            for pattern in patterns
        )

    def _resolved(self, problem: PlanningProblem, fact: Fact) -> Fact:
        """Return the literal with the full names of things, each of the right type."""
        signatures = {**problem.predicates, **self.signatures}
        types = signatures.get(fact.predicate)
        if types is None:
            raise GoalError(f"unknown predicate {fact.predicate!r}; {suggestion(fact.predicate, list(signatures))}")
        if len(types) != len(fact.arguments):
            raise GoalError(f"{fact}: {fact.predicate} takes {len(types)} of these: {', '.join(types) or 'nothing'}")
        wrong, names = GoalFaults(), list[str]()
        for name, kind in zip(fact.arguments, types, strict=True):
            with wrong.step():
                names.append(full_name(problem, name, kind))
        wrong.raise_if_any()
        return Fact(fact.predicate, tuple(names))

    def _is_short(self, predicate: str) -> bool:
        return predicate in self.predicates and bool(self.predicates[predicate].means)

    def _meaning(self, condition: Condition) -> Condition:
        """Return the expansion of an abbreviation such as ``accessible(fridge/shelf_1)``; other conditions
        unchanged.
        """
        if isinstance(condition, Forall) or not self._is_short(condition.fact.predicate):
            return condition
        if condition.negated:
            raise GoalError(f"{condition}: {condition.fact.predicate} cannot be negated; name what should be shut")
        predicate = self.predicates[condition.fact.predicate]
        (meaning,) = parse_conditions(predicate.means)
        return meaning.bound(_values(predicate, condition.fact.arguments))

    def _written_out(self, operator: Operator) -> Operator:
        pre, hold = (tuple(map(self._meaning, conditions)) for conditions in (operator.pre, operator.hold))
        return replace(operator, pre=pre, hold=hold)


def full_name(problem: PlanningProblem, name: str, kind: str) -> str:
    """Return the full name of a thing: ``table`` for its only or first surface, ``drawer_3`` for the only one.

    A name without a number means the first one; an ambiguous choice is logged. Raises GoalError for an unknown name.
    """
    known = problem.of_type(kind)
    if name in known:
        return name
    of_furniture = [one for one in known if one.startswith(f"{name}/")]
    parts = [one for one in known if one.endswith(f"/{name}")]
    numbered = [one for one in known if without_number(one) == name]
    if of_furniture and (kind == "place" or len(of_furniture) == 1):
        found = of_furniture[0]
    elif len(parts) == 1:
        found = parts[0]
    elif of_furniture or parts:
        raise GoalError(f"{name!r} is ambiguous; name one of {', '.join(of_furniture or parts)}")
    elif numbered:
        found = numbered[0]
    else:
        own = next((one for one in problem.objects if name in (one, *one.split("/"))), None)
        if own is None:
            raise GoalError(f"unknown {kind} {name!r}; {suggestion(name, known)}")
        raise GoalError(
            f"{name} is {with_article(problem.objects[own])}, and {with_article(kind)} is expected; "
            f"{suggestion(name, known)}"
        )
    others = [one for one in known if one != found and (one in of_furniture or name in _words(one))]
    if others:
        verb = "are" if len(others) > 1 else "is"
        _LOG.warning("%r is taken for %s; there %s also %s", name, found, verb, ", ".join(others))
    return found


def _values(predicate: Predicate, arguments: Sequence[str]) -> dict[str, str]:
    """Return ``{object}`` → ``mug`` for the parameters of a declaration."""
    return {f"{{{name}}}": value for name, value in zip(predicate.parameters, arguments, strict=True)}


def _words(name: str) -> list[str]:
    """Return the words of a name: ``lower`` and ``door`` of ``fridge/lower_door``."""
    return name.rpartition("/")[2].split("_")


def without_number(name: str) -> str:
    """Return a name without path and number: ``drawer`` for ``drawer_chest/drawer_3``."""
    return _NUMBER.sub("", name.rpartition("/")[2])


def _uses(operator: Operator) -> Iterable[tuple[Fact, tuple[str, ...]]]:
    """Yield each fact of an operator with the types that its parameters give its arguments."""
    for condition in (*operator.pre, *operator.hold, *operator.effects):
        kinds = {f"{{{name}}}": kind for name, kind in operator.parameters.items()}
        if isinstance(condition, Forall):
            kinds[condition.variable] = condition.type
            facts = [condition.then.fact, *([condition.given] if condition.given else [])]
        else:
            facts = [condition.fact]
        for fact in facts:
            yield fact, tuple(kinds.get(argument, "object") for argument in fact.arguments)


def _fit(types: tuple[str, ...], wanted: tuple[str, ...]) -> bool:
    """Return whether things of some types may be used where others are expected."""
    return len(types) == len(wanted) and all(
        kind == asked or asked in SUPERTYPES.get(kind, ()) for kind, asked in zip(types, wanted, strict=True)
    )
