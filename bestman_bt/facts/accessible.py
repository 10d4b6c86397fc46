"""``accessible``, ``behind``, ``in_the_way``, ``drawer``, ``blocked``: what blocks access to a place."""

from __future__ import annotations

from bestman_bt.facts.predicate import Beliefs, Predicate
from bestman_bt.world_model.openness import containers_before, is_open


def _behind(beliefs: Beliefs, place: str, container: str) -> bool:
    return container in containers_before(*beliefs.world.map.surface(place))


def _accessible(beliefs: Beliefs, place: str) -> bool:
    return all(is_open(beliefs.world, name) for name in containers_before(*beliefs.world.map.surface(place)))


BLOCKED = Predicate(
    "blocked",
    {"place": "place"},
    "there was nowhere to stand from where the {place} could be reached, and no door or drawer has moved since",
    lambda beliefs, place: place in beliefs.world.blocked,
)
IN_THE_WAY = Predicate(
    "in_the_way",
    {"container": "container", "place": "place"},
    "there was nowhere to stand from where the {place} could be reached while the {container} was open",
    lambda beliefs, container, place: (container, place) in beliefs.world.in_the_way,
)
BEHIND = Predicate(
    "behind",
    {"place": "place", "container": "container"},
    "the {container} has to be open for the {place} to be reached",
    _behind,
)
ACCESSIBLE = Predicate(
    "accessible",
    {"place": "place"},
    "all that has to be open for the {place} to be reached is open",
    _accessible,
    means="forall c - container: behind({place}, c) -> open(c)",
)
DRAWER = Predicate(
    "drawer",
    {"place": "place"},
    "the {place} moves with a drawer",
    lambda beliefs, place: beliefs.world.map.surface(place)[1].drawer is not None,
)
