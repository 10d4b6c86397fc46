"""``on``: an object is on a surface, or in a drawer."""

from __future__ import annotations

from bestman_bt.facts.evidence import Evidence
from bestman_bt.facts.holding import is_held
from bestman_bt.facts.predicate import Beliefs, Predicate
from bestman_bt.facts.standing import is_over, rest_faults, tilt_fault
from bestman_bt.world_model.world_model import WorldModel


def _holds(beliefs: Beliefs, name: str, place: str) -> bool:
    belief = beliefs.world.objects.get(name)
    return belief is not None and _full_name(beliefs.world, belief.surface) == place


def _full_name(world: WorldModel, surface: str | None) -> str | None:
    """Return the full name of a surface; ``table`` is short for the first surface of the table."""
    if surface is None:
        return None
    furniture, found = world.map.surface(surface)
    return f"{furniture.name}/{found.name}"


def _why_not(evidence: Evidence, name: str, place: str) -> str:
    """Return why the object is not on the surface: it should be released, at rest, above it and, except in a drawer,
    upright.
    """
    if name not in evidence.before:
        return f"there is no {name} in the scene"
    faults = [] if is_over(evidence, name, place) else [f"not on {place}"]
    faults += rest_faults(evidence, name, place)
    if evidence.task.world_model.map.surface(place)[1].drawer is None:
        faults += tilt_fault(evidence, evidence.truth.object_pose(name))
    return f"the {name} is " + ", ".join(faults) if faults else ""


def _why_still(evidence: Evidence, name: str, place: str) -> str:
    """Return why the object still counts as on a surface: it is above it, in any orientation, or touches the piece and
    no other surface of it.

    An object in the hand counts as off.
    """
    if name not in evidence.before or is_held(evidence, name):
        return ""
    if is_over(evidence, name, place):
        return f"the {name} is on {place}"
    piece, _ = evidence.task.world_model.map.surface(place)
    if any(is_over(evidence, name, f"{piece.name}/{other.name}") for other in piece.surfaces):
        return ""
    return f"the {name} touches the {piece.name}" if piece.name in evidence.truth.supports(name) else ""


ON = Predicate(
    "on",
    {"object": "object", "place": "place"},
    "the {object} is on (or in) the {place}",
    _holds,
    excludes=("on({object}, _)", "holding({object})"),
    known_if="located({object})",
    why_not=_why_not,
    why_still=_why_still,
)
