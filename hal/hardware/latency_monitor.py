"""Notices what comes late for a while."""

from __future__ import annotations

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
