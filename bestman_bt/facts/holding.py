"""``holding``, ``hand_empty``: the held object, if any."""

from __future__ import annotations

from bestman_bt.facts.evidence import Evidence
from bestman_bt.facts.predicate import Beliefs, Predicate


def is_held(evidence: Evidence, name: str) -> bool:
    """Return whether the robot presses on an object that has no other support."""
    return evidence.truth.touches_robot(name) and not evidence.truth.supports(name)


def believed_held(beliefs: Beliefs, name: str) -> bool:
    """Return whether a hand is believed to hold an object."""
    return beliefs.world.arm_with(name) is not None


def _why_not(evidence: Evidence, name: str) -> str:
    if name not in evidence.before:
        return f"there is no {name} in the scene"
    return "" if is_held(evidence, name) else f"the {name} is not in the hand"


def _pressed(evidence: Evidence, name: str) -> str:
    """Return how the robot still holds or presses on the object; empty if it does not touch it."""
    if name not in evidence.before or not evidence.truth.touches_robot(name):
        return ""
    return f"the hand holds the {name}" if is_held(evidence, name) else f"the robot presses on the {name}"


def _not_empty(evidence: Evidence) -> str:
    pressed = [name for name in evidence.truth.object_names if evidence.truth.touches_robot(name)]
    held = [name for name in pressed if is_held(evidence, name)]
    if held:
        return f"the hand holds the {held[0]}"
    return f"the robot presses on the {pressed[0]}" if pressed else ""


def _empty(evidence: Evidence) -> str:
    held = any(is_held(evidence, name) for name in evidence.truth.object_names)
    return "" if held else "the hand holds nothing"


HOLDING = Predicate(
    "holding",
    {"object": "object"},
    "the hand holds the {object}",
    believed_held,
    excludes=("holding(_)", "hand_empty"),
    why_not=_why_not,
    why_still=_pressed,
)
HAND_EMPTY = Predicate(
    "hand_empty", {}, "the hand is empty", lambda beliefs: not beliefs.world.hands, why_not=_not_empty, why_still=_empty
)
