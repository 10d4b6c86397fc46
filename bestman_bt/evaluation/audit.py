"""The audit of a run: the simulator's records, judged by declared contacts and the contacts that the task allows."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from bestman_bt.evaluation.declared_contacts import Declared, DeclaredContacts

if TYPE_CHECKING:
    from hal.simulation.audit_record import AuditRecord, ContactIncident, DisturbanceEvent, Finding

    T = TypeVar("T", ContactIncident, DisturbanceEvent, Finding, Declared)

TIMES = ("stamp", "start", "end", "until")
"""Names of times in records."""
LISTED = 20
"""Largest number of listed details per kind; the counters include all."""
TOLD = 3
"""Largest number of them in the reason of a failure."""

CHEATS = ("teleports", "grasp_constraints", "ground_truth_reads", "tampering", "object_follows_open_hand")
"""The counters that an honest run leaves at 0."""


def counter_words(cheat: str) -> str:
    """Return a counter's name, for people."""
    return cheat.replace("_", " ")


@dataclass(frozen=True)
class Collision:
    """A contact of the robot, or of the held object, that was not allowed or was too strong.

    Times in simulated seconds, ``peak_force`` in newtons. ``why``: the reason, if skills declare contacts.
    """

    first: str
    second: str
    start: float
    end: float
    peak_force: float
    why: str = ""


@dataclass(frozen=True)
class Audit:
    """The counters of ``result.json``. The first five kinds are violations of honest simulation; the others are faults
    of a run.

    ``teleports``: resets of poses, joints or states, called or detected. ``grasp_constraints``: constraints made after
    the scene was built. ``ground_truth_reads``: reads of poses that are not available to a robot. ``tampering``:
    external forces, changed masses or frictions, motors driven past the Robotics API. ``object_follows_open_hand``:
    objects that moved with the hand although the fingers did not press on them. ``collisions``: caused by the robot.
    ``contacts_by_walkers``: people who walked into a robot that did not move towards them; not a fault.
    ``disturbances``: descriptions of the scripted events of the scene. ``declared_contacts``: contacts that skills
    declared and made.
    """

    teleports: int
    grasp_constraints: int
    ground_truth_reads: int
    tampering: int
    object_follows_open_hand: int
    collisions: tuple[Collision, ...]
    max_penetration_mm: float
    max_penetration_pair: tuple[str, str] | None
    joint_limit_violations: int
    velocity_limit_violations: int
    findings: tuple[str, ...]
    contacts_by_walkers: tuple[Collision, ...] = ()
    disturbances: tuple[str, ...] = ()
    declared_contacts: tuple[dict[str, Any], ...] = ()

    @property
    def honest(self) -> bool:
        """Return whether the run has no cheats."""
        return not any(getattr(self, cheat) for cheat in CHEATS)

    def faults(self, max_penetration: float) -> tuple[str, ...]:
        """Return why an episode fails regardless of its tree: collisions, and violations beyond the monitor's
        tolerances.

        These are overlaps deeper than ``max_penetration`` m, joint limits and speeds
        (``hal.simulation.motion_watcher``).
        """
        faults = [
            f"collision of {c.first} with {c.second} ({c.peak_force:.1f} N)" + (f": {c.why}" if c.why else "")
            for c in self.collisions
        ]
        if self.max_penetration_mm > 1e3 * max_penetration and self.max_penetration_pair is not None:
            pair = " and ".join(self.max_penetration_pair)
            faults.append(
                f"{pair} overlap by {self.max_penetration_mm:.2f} mm, {1e3 * max_penetration:.2f} are allowed"
            )
        beyond, fast = self.joint_limit_violations, self.velocity_limit_violations
        faults += [f"joints were beyond their limits by more than 5 mrad or mm ({beyond} times)"] if beyond else []
        faults += [f"joints were faster than their limits by more than 5 % ({fast} times)"] if fast else []
        return tuple(faults)

    def objections(self, max_penetration: float) -> tuple[str, ...]:
        """Return why an episode fails: first the violations of honest simulation with their counts, then ``faults``."""
        cheats = [f"{counter_words(cheat)} {getattr(self, cheat)}" for cheat in CHEATS if getattr(self, cheat)]
        found = self.findings[:TOLD] + (("…",) if len(self.findings) > TOLD else ())
        return ((", ".join(cheats), *found) if cheats else ()) + self.faults(max_penetration)

    def to_document(self) -> dict[str, Any]:
        """Return the ``audit`` of ``result.json``: counters first, then their details."""
        document = asdict(self)
        document["collisions"] = len(self.collisions)
        document["collision_details"] = [_collision_document(collision) for collision in self.collisions[:LISTED]]
        document["contacts_by_walkers"] = len(self.contacts_by_walkers)
        document["contacts_by_walkers_details"] = [
            _collision_document(contact) for contact in self.contacts_by_walkers[:LISTED]
        ]
        document["disturbances"] = list(self.disturbances)
        document["declared_contacts"] = list(self.declared_contacts)
        document["max_penetration_mm"] = round(self.max_penetration_mm, 3)
        document["max_penetration_pair"] = list(self.max_penetration_pair) if self.max_penetration_pair else None
        document["findings"] = list(self.findings)
        return document


def audit(
    record: AuditRecord,
    allowed_contacts: Iterable[tuple[str, str]] | None = None,
    script: Collection[DisturbanceEvent] = (),
    declared: Sequence[Declared] | None = None,
    models: Mapping[str, str] | None = None,
    began: float = 0.0,
) -> Audit:
    """Return the audit of a simulation record.

    ``allowed_contacts``: pairs of names, in any order: an object, a piece of furniture, a door or drawer
    (``furniture/name``), ``fingers``, a link of the robot, or ``robot`` for all its links. ``declared``: contacts that
    skills declared; only these are allowed, and if ``allowed_contacts`` is given, only those in both. Without skills,
    those in ``allowed_contacts``. ``models``: object of the scene → model. ``script``: the evaluation's own changes of
    the world; any other exemption in the record is tampering. ``began``: start of the run on the monitor's clock,
    seconds; times in the result are relative to it.
    """
    record, script = _since(record, began), [_shifted(event, began) for event in script]
    declared = None if declared is None else [_shifted(one, began) for one in declared]
    pairs = None if allowed_contacts is None else {frozenset(pair) for pair in allowed_contacts}
    judged = DeclaredContacts(declared or (), models or {}, lambda one: pairs is None or _is_allowed(one, pairs))
    collisions: list[Collision] = []
    for contact in record.contacts:
        if contact.by_walker:
            continue
        if contact.kinds[1] in ("robot", "fingers"):
            collisions.append(replace(_collision(contact), why="the robot collides with itself"))
        elif declared is not None:
            why = judged.objection(contact)
            if why:
                second = contact.articulation or contact.second
                collisions.append(Collision(contact.first, second, contact.start, contact.end, contact.peak_force, why))
        elif not _is_allowed(contact, pairs or set()):
            collisions.append(_collision(contact))
    blameless = {(contact.first, contact.second) for contact in record.contacts if contact.by_walker}
    blameless -= {(contact.first, contact.second) for contact in record.contacts if not contact.by_walker}
    deepest = next((p for p in record.penetrations if (p.first, p.second) not in blameless), None)
    details: list[Finding] = [
        *record.jumps,
        *record.hidden_constraints,
        *record.changes,
        *record.unexplained_forces,
        *record.open_hand,
        *record.joint_limits,
        *record.velocity_limits,
    ]
    calls = [f"{name} was called {count} times after the scene was built" for name, count in record.calls.items()]
    if record.missed_looks:
        calls.append(f"the monitor missed {record.missed_looks} observations")
    others = _events_of_others(record.events, script)
    details += others
    seen = [f"{detail.stamp:.2f} s: {detail.text}" for detail in sorted(details, key=lambda detail: detail.stamp)]
    return Audit(
        teleports=max(record.resets, len(record.jumps)),
        grasp_constraints=max(record.constraints, len(record.hidden_constraints)),
        ground_truth_reads=record.truth_reads,
        tampering=record.tampering
        + len(record.changes)
        + len(record.unexplained_forces)
        + len(others)
        + record.missed_looks,
        object_follows_open_hand=len(record.open_hand),
        collisions=tuple(collisions),
        max_penetration_mm=1e3 * deepest.depth if deepest else 0.0,
        max_penetration_pair=(deepest.first, deepest.second) if deepest else None,
        joint_limit_violations=len(record.joint_limits),
        velocity_limit_violations=len(record.velocity_limits),
        findings=(*calls[:LISTED], *seen[:LISTED]),
        contacts_by_walkers=tuple(_collision(contact) for contact in record.contacts if contact.by_walker),
        disturbances=tuple(f"{event.stamp:.2f} s: {event.text}" for event in record.disturbances[:LISTED]),
        declared_contacts=tuple(judged.made()),
    )


def _since(record: AuditRecord, began: float) -> AuditRecord:
    """Return the record with all times but those of penetrations, which are not reported, counted from ``began`` on."""
    lists = {field.name: getattr(record, field.name) for field in fields(record) if field.name != "penetrations"}
    shifted: dict[str, Any] = {
        name: tuple(_shifted(one, began) for one in seen) for name, seen in lists.items() if type(seen) is tuple
    }
    return replace(record, **shifted)


def _shifted(seen: T, began: float) -> T:
    return replace(seen, **{name: getattr(seen, name) - began for name in TIMES if hasattr(seen, name)})


def _events_of_others(forgiven: Collection[DisturbanceEvent], script: Collection[DisturbanceEvent]) -> list[Finding]:
    """Return the differences between events that the monitor has excused and events that the script has caused."""
    from hal.simulation.audit_record import Finding

    unasked = [
        Finding(event.stamp, f"not by the task's script: {event.text}") for event in forgiven if event not in script
    ]
    unknown = [
        Finding(event.stamp, f"hidden from the monitor: {event.text}") for event in script if event not in forgiven
    ]
    return unasked + unknown


def _collision_document(collision: Collision) -> dict[str, Any]:
    described = {
        "pair": [collision.first, collision.second],
        "start_s": round(collision.start, 3),
        "end_s": round(collision.end, 3),
        "peak_force_n": round(collision.peak_force, 2),
    }
    return {**described, "why": collision.why} if collision.why else described


def _is_allowed(contact: ContactIncident, allowed: set[frozenset[str]]) -> bool:
    names = {"fingers": ["fingers", "robot"], "robot": ["robot"]}.get(contact.kinds[0], [])
    others = {contact.second, contact.articulation} - {""}
    return not {frozenset((name, other)) for name in (contact.first, *names) for other in others}.isdisjoint(allowed)


def _collision(contact: ContactIncident) -> Collision:
    return Collision(contact.first, contact.second, contact.start, contact.end, contact.peak_force)
