"""The clock of another machine, by when its messages arrive here."""

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
