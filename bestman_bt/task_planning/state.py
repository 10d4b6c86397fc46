"""The symbolic state, read from what the robot believes: which facts hold, and of which things one can speak."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

from bestman_bt.registry import PREDICATES
from bestman_bt.task_planning.predicates import Beliefs, Predicate, surfaces
from bestman_bt.task_planning.symbolic.problem import Fact
from bestman_bt.world_model import WorldModel

SUPERTYPES: dict[str, tuple[str, ...]] = {"drawer": ("place", "container")}
"""A drawer goes by one name, whether something is put into it or it is opened."""


def known_predicates() -> dict[str, Predicate]:
    """All predicates that have a function, by name: the shipped ones and those of entry points."""
    return {name: _predicate(name) for name in PREDICATES.names()}


def things(world: WorldModel) -> dict[str, str]:
    """Name → type of all that facts may be about: objects, surfaces of the map, its doors and drawers."""
    held = [one.name for one in world.hands.values()]
    found = dict.fromkeys([*world.models, *world.objects, *held], "object")
    found |= dict.fromkeys(surfaces(world), "place")
    for piece in world.map.furniture.values():
        for leaf in piece.leaves if not piece.is_passage else ():
            name = f"{piece.name}/{leaf.name}"
            found[name] = "drawer" if found.get(name) == "place" else "container"
    return found


def holds(beliefs: Beliefs, fact: Fact) -> bool:
    """Whether a fact is believed; UnknownNameError for a predicate that has no function."""
    return _predicate(fact.predicate).holds(beliefs, *fact.arguments)


def read_state(beliefs: Beliefs, objects: Mapping[str, str] | None = None) -> frozenset[Fact]:
    """All facts that are believed, of the given things or of all."""
    kinds: dict[str, list[str]] = {}
    for name, kind in (things(beliefs.world) if objects is None else objects).items():
        for each in (kind, *SUPERTYPES.get(kind, ())):
            kinds.setdefault(each, []).append(name)
    state = set()
    for predicate in known_predicates().values():
        if predicate.means:  # only short for others
            continue
        for arguments in product(*(kinds.get(kind, ()) for kind in predicate.types)):
            if predicate.holds(beliefs, *arguments):
                state.add(Fact(predicate.name, arguments))
    return frozenset(state)


def _predicate(name: str) -> Predicate:
    found: object = PREDICATES.resolve(name)
    if not isinstance(found, Predicate):
        raise TypeError(f"the predicate {name!r} should be a Predicate, got {found!r}")
    return found
