"""``located``, ``unseen``: whether the place of an object is known, and where it may be."""

from __future__ import annotations

from bestman_bt.facts.holding import believed_held
from bestman_bt.facts.predicate import Beliefs, Predicate


def _located(beliefs: Beliefs, name: str) -> bool:
    return name in beliefs.world.objects or believed_held(beliefs, name)


LOCATED = Predicate(
    "located",
    {"object": "object"},
    "it is known where the {object} is",
    _located,
    excludes=("unseen({object}, _)",),
    negatable=False,
)
UNSEEN = Predicate(
    "unseen",
    {"object": "object", "place": "place"},
    "it is not known where the {object} is, and it was not looked for at the {place} since",
    lambda beliefs, name, place: beliefs.world.may_be_on(name, place),
)
