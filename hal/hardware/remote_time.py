"""The clock of another machine, by when its messages arrive here, and whether they come late."""

from __future__ import annotations

import threading

LONGEST_DRIFT = 1e-4
"""Seconds per second by which the other clock may run slower than ours."""


class RemoteTime:
    """Brings stamps of another clock to ours. The message that came the fastest counts as if it took no time.

    The least difference between arrival and stamp is the offset of the clocks (the minimum filter of Cristian,
    "Probabilistic clock synchronization", 1989); it may grow again as clocks drift, no faster. Safe from any thread.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._offset: float | None = None
        self._updated = 0.0

    def forget(self) -> None:
        """The other clock may be another one from now on."""
        with self._lock:
            self._offset = None

    def here(self, stamp: float, received: float) -> float:
        """Time on our clock of what the other one stamped ``stamp`` and we received at ``received``, at most that."""
        with self._lock:
            if self._offset is None:
                self._offset = received - stamp
            else:
                drifted = self._offset + LONGEST_DRIFT * max(0.0, received - self._updated)
                self._offset = min(received - stamp, drifted)
            self._updated = max(self._updated, received)
            return stamp + self._offset


LATE_TIME = 0.15
"""Seconds that things have to come late before that counts."""


class LatencyMonitor:
    """``lag``: seconds by which the last message, or the last answer, was late. A single late one does not count."""

    def __init__(self) -> None:
        self.lag = 0.0
        self._since: float | None = None

    def forget(self) -> None:
        """Nothing of what has come counts any more."""
        self.lag, self._since = 0.0, None

    def late(self, longest_delay: float, now: float) -> float | None:
        """By how much they have come late for a while, if that is more than ``longest_delay``, else None.

        To be asked often: times are those at which it is asked.
        """
        if self.lag <= longest_delay:
            self._since = None
        elif self._since is None:
            self._since = now
        elif now - self._since > LATE_TIME:
            return self.lag
        return None
