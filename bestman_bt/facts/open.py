"""``open``, ``closed``: how far a door or drawer is open, by the openings that skills go by; ``locked``, ``stuck``."""

from __future__ import annotations

from bestman_bt.facts.evidence import Evidence
from bestman_bt.facts.predicate import Predicate
from bestman_bt.world_model import Openness, is_open, is_shut, leaf_called, openness_of


def _measured(evidence: Evidence, container: str) -> tuple[float, Openness]:
    """How far it is open, and what that means."""
    openness = openness_of(leaf_called(evidence.task.world_model, container))
    return evidence.truth.articulation_position(container), openness


def _not_open(evidence: Evidence, container: str) -> str:
    position, openness = _measured(evidence, container)
    return "" if position >= openness.enough else f"the {container} is not open"


def _still_open(evidence: Evidence, container: str) -> str:
    return "" if _not_open(evidence, container) else f"the {container} is open"


def _not_shut(evidence: Evidence, container: str) -> str:
    position, openness = _measured(evidence, container)
    return "" if position <= openness.shut else f"the {container} is not shut"


def _still_shut(evidence: Evidence, container: str) -> str:
    return "" if _not_shut(evidence, container) else f"the {container} is shut"


OPEN = Predicate(
    "open",
    {"container": "container"},
    "the {container} is open far enough to work behind it",
    lambda beliefs, container: is_open(beliefs.world, container),
    excludes=("closed({container})",),
    why_not=_not_open,
    why_still=_still_open,
)
CLOSED = Predicate(
    "closed",
    {"container": "container"},
    "the {container} is shut",
    lambda beliefs, container: is_shut(beliefs.world, container),
    why_not=_not_shut,
    why_still=_still_shut,
)
LOCKED = Predicate(
    "locked",
    {"container": "container"},
    "the {container} did not open when it was tried",
    lambda beliefs, container: container in beliefs.world.locked,
)
STUCK = Predicate(
    "stuck",
    {"container": "container"},
    "the {container} could not be opened, for no reason that has to last, and no door or drawer has moved since",
    lambda beliefs, container: container in beliefs.world.blocked,
)
