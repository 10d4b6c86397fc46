"""What somebody who disturbs with a run tells its monitor, which forgives his events and keeps a record of each."""

from __future__ import annotations

from hal.pybullet.audit_record import DisturbanceEvent, Finding


class DisturbanceLog:
    """``events``: what was done; none is ever taken back. ``log``: what came of it, in words.

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
        """Say what came of an event."""
        self.log += (event,)

    def rest(self, event: DisturbanceEvent) -> None:
        """What an event leads to waits or is over."""
        self._resting.add(event)

    def resume(self, event: DisturbanceEvent) -> None:
        """It goes on."""
        self._resting.discard(event)

    def rests(self, event: DisturbanceEvent) -> bool:
        """Whether it does, now."""
        return event in self._resting
