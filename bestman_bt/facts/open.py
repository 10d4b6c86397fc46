"""``open``, ``closed``: by the thresholds of the skills; ``locked``, ``stuck``."""

from __future__ import annotations

from bestman_bt.facts.evidence import Evidence
from bestman_bt.facts.predicate import Predicate
from bestman_bt.world_model.openness import articulation_called, is_open, is_shut, openness_of


def _is_open(evidence: Evidence, container: str) -> bool:
    openness = openness_of(articulation_called(evidence.task.world_model, container))
    return evidence.truth.articulation_position(container) >= openness.enough


def _is_shut(evidence: Evidence, container: str) -> bool:
    openness = openness_of(articulation_called(evidence.task.world_model, container))
    return evidence.truth.articulation_position(container) <= openness.shut


OPEN = Predicate(
    "open",
    {"container": "container"},
    "the {container} is open far enough to work behind it",
    lambda beliefs, container: is_open(beliefs.world, container),
    excludes=("closed({container})",),
    why_not=lambda evidence, name: "" if _is_open(evidence, name) else f"the {name} is not open",
    why_still=lambda evidence, name: f"the {name} is open" if _is_open(evidence, name) else "",
)
CLOSED = Predicate(
    "closed",
    {"container": "container"},
    "the {container} is shut",
    lambda beliefs, container: is_shut(beliefs.world, container),
    why_not=lambda evidence, name: "" if _is_shut(evidence, name) else f"the {name} is not shut",
    why_still=lambda evidence, name: f"the {name} is shut" if _is_shut(evidence, name) else "",
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
