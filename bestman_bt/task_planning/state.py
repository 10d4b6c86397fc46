"""The symbolic state of the beliefs: the facts that hold, and the known things."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product
from typing import TypeVar

from bestman_bt.engine.own_files import describe_error, user_line
from bestman_bt.facts.predicate import Beliefs, Predicate
from bestman_bt.registry import PREDICATES
from bestman_bt.task_planning.symbolic.facts import parse_conditions
from bestman_bt.task_planning.symbolic.problem import Fact, Literal, PlanningError
from bestman_bt.world_model.world_model import WorldModel

T = TypeVar("T")

TYPES = ("object", "place", "container", "drawer")
SUPERTYPES: dict[str, tuple[str, ...]] = {"drawer": ("place", "container")}
"""A drawer has one name, both as a place for objects and as a container to open."""


class PredicateError(PlanningError):
    """A user's predicate has raised an error, so that its value is unknown."""


def surfaces(world: WorldModel) -> list[str]:
    """Return the names of all places, ``furniture/surface``."""
    return [f"{piece.name}/{surface.name}" for piece in world.map.furniture.values() for surface in piece.surfaces]


def known_predicates() -> dict[str, Predicate]:
    """Return all declared predicates by name: shipped, of plug-ins and of entry points."""
    return {name: _predicate(name) for name in PREDICATES.names()}


def things(world: WorldModel) -> dict[str, str]:
    """Return name → type of all arguments of facts: objects, surfaces of the map, doors and drawers."""
    held = [one.name for one in world.hands.values()]
    found = dict.fromkeys([*world.models, *world.objects, *held], "object")
    found |= dict.fromkeys(surfaces(world), "place")
    for piece in world.map.furniture.values():
        for door in piece.articulations if not piece.is_passage else ():
            name = f"{piece.name}/{door.name}"
            found[name] = "drawer" if found.get(name) == "place" else "container"
    return found


def holds(beliefs: Beliefs, fact: Fact, declared: Collection[str] = ()) -> bool:
    """Return whether a fact is believed. ``declared``: predicates of abilities without a function.

    Raises UnknownNameError for other predicates, PredicateError if a user's own raises.
    """
    if fact.predicate in declared and fact.predicate not in PREDICATES.names():
        return fact in achieved_facts(beliefs)
    predicate = _predicate(fact.predicate)
    return fact in achieved_facts(beliefs) if predicate.holds is None else _believed(predicate, beliefs, fact.arguments)


def asked(predicate: Predicate, function: Callable[..., T], of: object, arguments: Sequence[str]) -> T:
    """Return the value of a predicate's function. Raises PredicateError, with file and line, if a user's own raises."""
    try:
        return function(of, *arguments)
    except Exception as error:  # a user's function may raise anything; reported with its line
        if not user_line(error):
            raise
        fact = Fact(predicate.name, tuple(arguments))
        raise PredicateError(f"the predicate of {fact} raised {describe_error(error)}") from error


def _believed(predicate: Predicate, beliefs: Beliefs, arguments: Sequence[str]) -> bool:
    assert predicate.holds is not None
    return asked(predicate, predicate.holds, beliefs, arguments)


def achieved_facts(beliefs: Beliefs) -> set[Fact]:
    """Return the facts without a function that abilities have achieved and not undone since."""
    functions = {name: predicate for name, predicate in known_predicates().items() if predicate.holds is not None}
    kinds = things(beliefs.world)
    believed: set[Fact] = set()

    def is_given(fact: Fact | None) -> bool:
        if fact is None:
            return True
        known = functions.get(fact.predicate)
        return fact in believed if known is None else _believed(known, beliefs, fact.arguments)

    for effects in beliefs.world.achieved_effects:
        literals: list[Literal] = []
        for condition in parse_conditions(effects):
            if isinstance(condition, Literal):
                literals.append(condition)
                continue
            for name, kind in kinds.items():
                if condition.type in (kind, *SUPERTYPES.get(kind, ())):
                    given, then = condition.at(name)
                    literals += [then] if is_given(given) else []
        own = [literal for literal in literals if literal.fact.predicate not in functions]
        believed -= {literal.fact for literal in own if literal.negated}
        believed |= {literal.fact for literal in own if not literal.negated}
    return believed


def read_state(beliefs: Beliefs, objects: Mapping[str, str] | None = None) -> frozenset[Fact]:
    """Return all believed facts, or only those about ``objects``."""
    kinds: dict[str, list[str]] = {}
    objects = things(beliefs.world) if objects is None else objects
    for name, kind in objects.items():
        for each in (kind, *SUPERTYPES.get(kind, ())):
            kinds.setdefault(each, []).append(name)
    state = {fact for fact in achieved_facts(beliefs) if objects.keys() >= set(fact.arguments)}
    for predicate in known_predicates().values():
        if predicate.means or predicate.holds is None:  # short for others; achieved by abilities
            continue
        for arguments in product(*(kinds.get(kind, ()) for kind in predicate.types)):
            if _believed(predicate, beliefs, arguments):
                state.add(Fact(predicate.name, arguments))
    return frozenset(state)


def _predicate(name: str) -> Predicate:
    found: object = PREDICATES.resolve(name)
    if not isinstance(found, Predicate):
        raise TypeError(f"the predicate {name!r} should be a Predicate, got {found!r}")
    return found
