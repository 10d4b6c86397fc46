"""The observations of the audit monitor during a run; bestman_bt.evaluation.audit judges them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Body = Literal["fingers", "robot", "object", "furniture", "floor", "wall", "walker", "other"]
"""``fingers``: gripper links that grasp; ``robot``: any other link."""


@dataclass(frozen=True)
class ContactIncident:
    """A contact of two bodies with more than 1 N, including gaps of less than a quarter of a second.

    ``first``: the robot's link, or the object that it held. ``second``: the other body, or a link of another arm of the
    robot. ``kinds``: of both bodies. ``articulation``: the door or drawer, ``furniture/name``, if the second body is
    one. Times in simulated seconds, ``peak_force`` in newtons. ``by_walker``: a walker, or a door moved by a script,
    moved into the robot, whose body did not move towards it faster than 2 cm/s just before the contact, nor by more
    than 1 cm during it; all other contacts are attributed to the robot.
    """

    first: str
    second: str
    kinds: tuple[Body, Body]
    start: float
    end: float
    peak_force: float
    by_walker: bool = False
    articulation: str = ""


@dataclass(frozen=True)
class Penetration:
    """The deepest overlap of two bodies, metres, and its time, seconds."""

    first: str
    second: str
    depth: float
    stamp: float


@dataclass(frozen=True)
class Finding:
    """An observation that does not occur in a valid run: description and time (simulated seconds)."""

    stamp: float
    text: str


@dataclass(frozen=True)
class DisturbanceEvent:
    """An intervention on an object, door or drawer ``name``, from ``stamp`` to ``until`` (s).

    Kinds: ``put``: set down at ``pose`` (x, y, z in metres and quaternion xyzw of its centre of mass, in the map).
    ``slip``: without friction, until it has come to rest. ``push``: pushed shut by a hand. ``text``: its description.
    """

    stamp: float
    until: float
    kind: Literal["put", "slip", "push"]
    name: str
    text: str
    pose: tuple[float, ...] = ()


@dataclass(frozen=True)
class AuditRecord:
    """All findings since the scene was built.

    ``calls``: forbidden calls of the engine, by function name; ``resets``, ``constraints``, ``truth_reads`` and
    ``tampering`` are their sums by kind. ``missed_looks``: skipped observations of the monitor. The findings come from
    observation, regardless of the cause. ``disturbances``: actions of the scene's script, such as walking people.
    ``events``: interventions that were excused; the monitor does not know their cause.
    """

    duration: float
    resets: int
    constraints: int
    truth_reads: int
    tampering: int
    calls: Mapping[str, int]
    jumps: tuple[Finding, ...]
    hidden_constraints: tuple[Finding, ...]
    changes: tuple[Finding, ...]
    unexplained_forces: tuple[Finding, ...]
    joint_limits: tuple[Finding, ...]
    velocity_limits: tuple[Finding, ...]
    open_hand: tuple[Finding, ...]
    contacts: tuple[ContactIncident, ...]
    penetrations: tuple[Penetration, ...]
    missed_looks: int = 0
    disturbances: tuple[Finding, ...] = ()
    events: tuple[DisturbanceEvent, ...] = ()


class DisturbanceLog:
    """Announced interventions. ``events``: all of them; none is ever removed. ``log``: their effects, as text.

    A suspended event excuses no finding, even before its time is over.
    """

    def __init__(self) -> None:
        self.events: tuple[DisturbanceEvent, ...] = ()
        self.log: tuple[Finding, ...] = ()
        self._resting: set[DisturbanceEvent] = set()

    def announce(self, event: DisturbanceEvent) -> None:
        """Add an intervention that begins now."""
        self.events += (event,)

    def record(self, event: Finding) -> None:
        """Report the effect of an event."""
        self.log += (event,)

    def rest(self, event: DisturbanceEvent) -> None:
        """Suspend or end the effects of an event."""
        self._resting.add(event)

    def resume(self, event: DisturbanceEvent) -> None:
        """Resume an event."""
        self._resting.discard(event)

    def rests(self, event: DisturbanceEvent) -> bool:
        """Return whether an event is suspended now."""
        return event in self._resting


class CallCounter:
    """Counts calls by kind and by function, from ``seal`` on, when the scene is built.

    Until ``close_truth``, parts of the simulation and the evaluation may open readers whose calls are not counted.
    """

    def __init__(self) -> None:
        self._sealed = self.truth_closed = False
        self.counts: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()

    def seal(self) -> None:
        """Start counting: the scene is built."""
        self._sealed = True

    def close_truth(self) -> None:
        """End free access to the ground truth: functions that bypass the Robotics API are counted if obtained after
        this call."""
        self.truth_closed = True

    def note(self, kind: str, name: str) -> None:
        """Count a call of a function."""
        if self._sealed:
            self.counts[kind] += 1
            self.calls[name] += 1
