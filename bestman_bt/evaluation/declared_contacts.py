"""Decides which contacts of a run are allowed: declared by skills, and checked against monitor and scene.

A skill declares each intended contact (``behaviours.contacts``). The evaluation records the times, and determines
itself what a declaration can cover: finger links on one object or on one door or drawer, and an object in the hand on
furniture or floor. Other links, other bodies and stronger contacts are always collisions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from behaviours.contacts import MOST_FORCE, Contact

if TYPE_CHECKING:
    from hal.simulation.audit_record import ContactIncident

BEFORE = 0.1
"""Seconds by which a declaration may be older than the tick after which it is seen: two ticks at 20 Hz."""
AFTER = 0.25
"""Seconds by which a contact may be interrupted and still count as the same, as the monitor counts."""


@dataclass(frozen=True)
class Declared:
    """A contact that was declared from ``start`` to ``end``, seconds on the monitor's clock."""

    contact: Contact
    start: float
    end: float = math.inf


class ContactLog:
    """Records the declared contacts after each tick.

    ``active``: returns the current ones. ``now``: seconds on the monitor's clock. ``hands``: each handles one object,
    or one door or drawer, at a time; further declarations are not recorded.
    """

    def __init__(self, active: Callable[[], Sequence[Contact]], now: Callable[[], float], hands: int) -> None:
        self._active, self._now, self._hands = active, now, hands
        self._ended: list[Declared] = []
        self._open: dict[Contact, Declared] = {}

    def after_tick(self) -> None:
        """Record the current declarations."""
        active = self._within_hands(self._active())
        if active == list(self._open):
            return
        now = self._now()
        for contact in [contact for contact in self._open if contact not in active]:
            self._ended.append(replace(self._open.pop(contact), end=now))
        for contact in active:
            self._open.setdefault(contact, Declared(contact, now - BEFORE))

    @property
    def declared(self) -> tuple[Declared, ...]:
        """Return all contacts declared so far, in the order of their start."""
        return tuple(sorted([*self._ended, *self._open.values()], key=lambda declared: declared.start))

    def _within_hands(self, contacts: Sequence[Contact]) -> list[Contact]:
        things = list(dict.fromkeys(contact.thing for contact in contacts if contact.kind != "support"))
        return [c for c in contacts if c.kind == "support" or c.thing in things[: self._hands]]


@dataclass
class _Use:
    """A declaration and the contacts that it covers."""

    declared: Declared
    incidents: list[ContactIncident] = field(default_factory=list)

    def covers(self, incident: ContactIncident, models: Mapping[str, str]) -> bool:
        """Return whether it is the declared contact, by kinds, names and time."""
        contact, kinds = self.declared.contact, incident.kinds
        if contact.kind == "handle":
            fits = kinds == ("fingers", "furniture") and incident.articulation == contact.thing != ""
        elif contact.kind == "support":
            on = kinds[1] in ("furniture", "floor") and incident.second == contact.on
            fits = on and kinds[0] == "object" and self._is(incident.first, models)
        else:
            fits = kinds == ("fingers", "object") and self._is(incident.second, models)
        return fits and self._in_time(incident)

    def _is(self, name: str, models: Mapping[str, str]) -> bool:
        """Return whether the declared thing may be that object: by name, else by looks; after the first contact it is
        one.
        """
        contact = self.declared.contact
        if self.incidents:
            return name == (self.incidents[0].first if contact.kind == "support" else self.incidents[0].second)
        thing = contact.thing
        return thing == name or thing not in models or models[thing] == models.get(name)

    def _in_time(self, incident: ContactIncident) -> bool:
        """Return whether a contact began while it was declared, or during such a contact: all fingers
        of a grasp count.
        """
        spans = [(self.declared.start, self.declared.end), *((other.start, other.end) for other in self.incidents)]
        return any(start <= incident.start <= end + AFTER for start, end in spans)


class DeclaredContacts:
    """Judges contacts by declarations.

    ``models``: object of the scene → model, because the robot recognises objects by their appearance. ``allowed``:
    whether the task allows a declared contact.
    """

    def __init__(
        self, declared: Iterable[Declared], models: Mapping[str, str], allowed: Callable[[ContactIncident], bool]
    ) -> None:
        self._uses = [_Use(one) for one in declared]
        self._models, self._allowed = models, allowed

    def objection(self, incident: ContactIncident) -> str:
        """Return why a contact is a collision, or an empty text. Call it in the order in which the contacts start."""
        use = next((use for use in self._uses if use.covers(incident, self._models)), None)
        if use is None:
            return "no skill declared it"
        if not self._allowed(incident):
            return "the task does not allow it"
        use.incidents.append(incident)
        most = min(use.declared.contact.max_force, MOST_FORCE)
        return "" if incident.peak_force <= most else f"{most:g} N were declared"

    def made(self) -> list[dict[str, Any]]:
        """Return the contacts that occurred as declared, for ``result.json``: skill, times (seconds) and forces
        (newtons).
        """
        return [_contact_document(use.declared.contact, use.incidents) for use in self._uses if use.incidents]


def _contact_document(contact: Contact, incidents: Sequence[ContactIncident]) -> dict[str, Any]:
    first = incidents[0]
    return {
        "skill": contact.skill,
        "kind": contact.kind,
        "pair": [first.first if contact.kind == "support" else "fingers", first.articulation or first.second],
        "start_s": round(min(one.start for one in incidents), 3),
        "end_s": round(max(one.end for one in incidents), 3),
        "peak_force_n": round(max(one.peak_force for one in incidents), 2),
        "max_force_n": round(min(contact.max_force, MOST_FORCE), 2),
    }
