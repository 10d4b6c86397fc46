"""Real time: sleeping waits, and runs the periodic calls of the thread that sleeps."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from hal.api import Clock, Timer

LONGEST_DRIFT = 1e-4
"""Seconds per second by which the other clock may run slower than ours."""


class RemoteTime:
    """Converts stamps of another clock to ours; the fastest message counts as having no latency.

    The smallest difference between arrival and stamp is the offset of the clocks (the minimum filter of Cristian,
    "Probabilistic clock synchronization", 1989); it grows at most with the drift of the clocks. Each source of messages
    needs its own object, because some sources stamp messages ahead of time, as AMCL does. Thread-safe.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._offset: float | None = None
        self._updated = 0.0

    def forget(self) -> None:
        """Discard the offset, because the other clock may have changed."""
        with self._lock:
            self._offset = None

    def here(self, stamp: float, received: float) -> float:
        """Return the time on our clock of a ``stamp`` of the other one, received at ``received``; at most
        ``received``.
        """
        with self._lock:
            self._offset = self._offset_with(stamp, received)
            self._updated = max(self._updated, received)
            return stamp + self._offset

    def tried(self, stamp: float, received: float) -> float:
        """Return the time of ``here`` without updating the offset, for a message whose validity is not known yet."""
        with self._lock:
            return stamp + self._offset_with(stamp, received)

    def _offset_with(self, stamp: float, received: float) -> float:
        if self._offset is None:
            return received - stamp
        return min(received - stamp, self._offset + LONGEST_DRIFT * max(0.0, received - self._updated))


FARTHEST_AHEAD, FARTHEST_BEHIND = 0.02, 0.4
"""Maximum seconds by which a stamp may be ahead of, or behind, the arrival of its message if clocks are synchronised.
"""


class SynchronisedTime(RemoteTime):
    """Uses the stamps of a clock synchronised by PTP or NTP with this machine's, regardless of message latency.

    ``ahead``: seconds by which the last message's stamp was ahead of its arrival.
    """

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock, self.ahead = clock, 0.0

    def _offset_with(self, stamp: float, received: float) -> float:
        offset = self._clock.now() - time.time()
        self.ahead = stamp + offset - received
        return min(offset, received - stamp)


LONGEST_REORDERING = 0.05
"""Maximum seconds by which the stamps of one source may decrease."""


class StampOrder:
    """Detects that a source's clock was set back: its stamps decrease, which no delay can cause."""

    def __init__(self) -> None:
        self._last: float | None = None

    def forget(self) -> None:
        """Accept any stamp as the next one."""
        self._last = None

    def set_back(self, stamp: float) -> bool:
        """Return whether the clock was set back between the last recorded stamp and this one."""
        return self._last is not None and stamp < self._last - LONGEST_REORDERING

    def note(self, stamp: float) -> None:
        """Record the latest stamp."""
        self._last = stamp


LATE_TIME = 0.15
"""Seconds of continuous lateness after which it counts."""


class LatencyMonitor:
    """Measures the latency of messages. ``lag``: latency of the last message or reply, seconds; single late ones are
    ignored.
    """

    def __init__(self) -> None:
        self.lag = 0.0
        self._since: float | None = None

    def forget(self) -> None:
        """Discard all measurements."""
        self.lag, self._since = 0.0, None

    def late(self, longest_delay: float, now: float) -> float | None:
        """Return the sustained delay of messages, seconds, if it exceeds ``longest_delay``, else None.

        Call it often: lateness is timed between calls.
        """
        if self.lag <= longest_delay:
            self._since = None
        elif self._since is None:
            self._since = now
        elif now - self._since > LATE_TIME:
            return self.lag
        return None


LONGEST_DEBT = 0.05
"""Maximum seconds by which a late sleep shortens the next one."""
AT_ONCE = 0.005
"""Seconds within which the next sleep has to begin for that."""


class _OfThread(threading.local):
    """State of one thread."""

    def __init__(self) -> None:
        self.timers: list[Timer] = []
        self.due = self.woke = -math.inf  # when the last sleep was to end, and when it did
        self.sleeping = False


class RealTimeClock(Clock):
    """The machine's monotonic clock, starting at 0 or at ``start``, seconds of that clock.

    As in simulation, periodic calls run while the thread that registered them sleeps, so that controllers need no
    locks. A thread that computes instead of sleeping delays its periodic calls: time-critical work (set-points,
    watchdogs) runs in threads of ``ControlLoop`` instead.
    """

    def __init__(self, start: float | None = None) -> None:
        self._start = time.monotonic() if start is None else start
        self._own = _OfThread()

    def now(self) -> float:
        """Return the seconds since the clock was created."""
        return time.monotonic() - self._start

    def sleep(self, duration: float) -> None:
        """Wait; many short sleeps take as long as a long one. Raises RuntimeError within a periodic call."""
        self._wait(duration, None)

    def wait(self, duration: float, wake: threading.Event) -> None:
        """Wait for up to ``duration`` seconds, until ``wake`` is set."""
        self._wait(duration, wake)

    def every(self, period: float, call: Callable[[], None]) -> Timer:
        """Call ``call`` every ``period`` seconds while this thread sleeps."""
        timer = Timer(period, self.now(), call)
        self._own.timers.append(timer)
        return timer

    def cancel_timers(self) -> None:
        """Cancel all periodic calls of this thread (on disconnect)."""
        for timer in self._own.timers:
            timer.cancel()
        self._own.timers.clear()

    def _wait(self, duration: float, wake: threading.Event | None) -> None:
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"sleep duration should be finite and not negative but is {duration!r}")
        own = self._own
        if own.sleeping:
            raise RuntimeError("sleep was called from a periodic call, which must return immediately")
        own.sleeping = True
        try:
            end = self._begin(own) + duration
            while True:
                self._run_due_timers()
                now = self.now()
                if now >= end or (wake is not None and wake.is_set()):
                    break
                until = min([end, *(timer.due for timer in own.timers)])
                if wake is None:
                    time.sleep(max(0.0, until - now))
                else:
                    wake.wait(max(0.0, until - now))
            own.due, own.woke = end, now
        finally:
            own.sleeping = False

    def _begin(self, own: _OfThread) -> float:
        """Return the start of a sleep: now, or the planned end of the last sleep if the thread sleeps again
        immediately.
        """
        now = self.now()
        goes_on = now - own.woke < AT_ONCE and 0.0 <= now - own.due < LONGEST_DEBT
        return own.due if goes_on else now

    def _run_due_timers(self) -> None:
        timers = self._own.timers
        for timer in tuple(timers):
            if not timer.cancelled and timer.due <= self.now():
                timer.run(self.now())
        if any(timer.cancelled for timer in timers):
            self._own.timers[:] = [timer for timer in timers if not timer.cancelled]
