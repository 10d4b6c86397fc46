"""What the monitor has seen of a run: facts, not judgements (those are bestman_bt.evaluation.audit's)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Body = Literal["fingers", "robot", "object", "furniture", "floor", "wall", "walker", "other"]
"""``fingers``: links of a gripper that take things; ``robot``: any other link."""


@dataclass(frozen=True)
class ContactIncident:
    """Two bodies pressed on each other with more than 1 N, with gaps of less than a quarter of a second.

    ``first``: the robot's link, or the object that it held. ``second``: the other body, or a link of another arm of the
    robot. ``kinds``: what these two are.
    ``leaf``: the door or drawer, ``furniture/name``, where the second is one. Times in simulated seconds,
    ``peak_force`` in newtons.
    ``by_walker``: a walker, or a door that a script moves, came into the robot, whose body did not move towards it
    faster than 2 cm/s just before they touched, nor by more than 1 cm as long as they did; every other contact is the
    robot's doing.
    """

    first: str
    second: str
    kinds: tuple[Body, Body]
    start: float
    end: float
    peak_force: float
    by_walker: bool = False
    leaf: str = ""


@dataclass(frozen=True)
class Penetration:
    """The deepest overlap of two bodies, metres, and when."""

    first: str
    second: str
    depth: float
    stamp: float


@dataclass(frozen=True)
class Finding:
    """Something that an honest, healthy run does not show: what, and when (simulated seconds)."""

    stamp: float
    text: str


@dataclass(frozen=True)
class DisturbanceEvent:
    """An intervention on an object, door or drawer ``name``, from ``stamp`` to ``until`` (s).

    ``put``: set down at ``pose`` (x, y, z and quaternion xyzw of its centre of mass, in the map). ``slip``: without
    friction, until it has come to rest. ``push``: a hand shuts it. ``text``: the same in words.
    """

    stamp: float
    until: float
    kind: Literal["put", "slip", "push"]
    name: str
    text: str
    pose: tuple[float, ...] = ()


@dataclass(frozen=True)
class AuditRecord:
    """Everything seen since the scene was built.

    ``calls``: calls of the engine that are not allowed then, by function name; ``resets``, ``constraints``,
    ``truth_reads`` and ``tampering`` are their sums by kind. ``missed_looks``: how often the
    monitor should have looked and was not let. The findings come from watching, whatever the cause. ``disturbances``:
    what the scene's script did, such as people who walk. ``events``: those that were forgiven; whose they were, the
    monitor does not know.
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
    """``events``: what was done; none is ever removed. ``log``: their effects, as text.

    An event may rest, before its time is over: then nothing is forgiven for it.
    """

    def __init__(self) -> None:
        self.events: tuple[DisturbanceEvent, ...] = ()
        self.log: tuple[Finding, ...] = ()
        self._resting: set[DisturbanceEvent] = set()

    def announce(self, event: DisturbanceEvent) -> None:
        """Something is done now."""
        self.events += (event,)

    def tell(self, event: Finding) -> None:
        """Report the effect of an event."""
        self.log += (event,)

    def rest(self, event: DisturbanceEvent) -> None:
        """Suspend or end the effects of an event."""
        self._resting.add(event)

    def resume(self, event: DisturbanceEvent) -> None:
        """Resume an event."""
        self._resting.discard(event)

    def rests(self, event: DisturbanceEvent) -> bool:
        """Return whether it does, now."""
        return event in self._resting


class Ledger:
    """Counts by kind and by function, from the moment on at which the scene is built (``seal``).

    Until ``close_truth``, the parts of the simulation and the evaluation take what they need without being counted.
    """

    def __init__(self) -> None:
        self._sealed = self.truth_closed = False
        self.counts: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()

    def seal(self) -> None:
        """The scene is built: count from now on."""
        self._sealed = True

    def close_truth(self) -> None:
        """Close the truth: functions past the Robotics API that are taken later are counted."""
        self.truth_closed = True

    def note(self, kind: str, name: str) -> None:
        """Count a call of a function."""
        if self._sealed:
            self.counts[kind] += 1
            self.calls[name] += 1
