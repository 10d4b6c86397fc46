"""What somebody who interferes with a run tells its monitor, which forgives his deeds and keeps a record of each."""

from __future__ import annotations

from hal.pybullet.honesty_record import Deed, Finding


class Interference:
    """``deeds``: what was done; none is ever taken back. ``log``: what came of it, in words.

    A deed may rest, before its time is over: then nothing is forgiven for it.
    """

    def __init__(self) -> None:
        self._deeds: tuple[Deed, ...] = ()
        self._log: tuple[Finding, ...] = ()
        self._resting: set[Deed] = set()

    @property
    def deeds(self) -> tuple[Deed, ...]:
        """All up to now."""
        return self._deeds

    @property
    def log(self) -> tuple[Finding, ...]:
        """What was told up to now, apart from the deeds' own words."""
        return self._log

    def announce(self, deed: Deed) -> None:
        """Something is done now."""
        self._deeds += (deed,)

    def tell(self, event: Finding) -> None:
        """Say what came of a deed."""
        self._log += (event,)

    def rest(self, deed: Deed) -> None:
        """What a deed leads to waits or is over."""
        self._resting.add(deed)

    def resume(self, deed: Deed) -> None:
        """It goes on."""
        self._resting.discard(deed)

    def rests(self, deed: Deed) -> bool:
        """Whether it does, now."""
        return deed in self._resting
