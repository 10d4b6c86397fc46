"""A thread that calls a function at a fixed rate and measures its lateness."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

REMEMBERED = 60_000
REAL_TIME_PRIORITY = 20


def take_real_time_priority(priority: int = REAL_TIME_PRIORITY) -> None:
    """Give the calling thread real-time priority, if the system allows it."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


@dataclass(frozen=True)
class Lateness:
    """The delay of cycle starts, seconds. ``missed``: cycles skipped because an earlier one took too long."""

    cycles: int
    median: float
    p99: float
    worst: float
    missed: int

    def __str__(self) -> str:
        """Return a line in milliseconds for display."""
        return (
            f"{self.cycles} cycles, late by {1e3 * self.median:.2f} ms (median), {1e3 * self.p99:.2f} ms (p99), "
            f"{1e3 * self.worst:.2f} ms (worst), {self.missed} left out"
        )


class ControlLoop:
    """Calls ``step(elapsed)`` at ``rate`` Hz, from ``start()`` to ``close()``.

    ``elapsed``: seconds since the last call began. A call that takes longer than its period delays the next one, and
    missed calls are skipped. An exception of ``step`` ends the loop and is passed to ``crashed``. If the system allows
    it (``ulimit -r``), the thread has real-time priority, so that a busy machine does not delay it.
    """

    def __init__(
        self, name: str, rate: float, step: Callable[[float], None], crashed: Callable[[Exception], None]
    ) -> None:
        self.name, self.rate = name, rate
        self._step, self._crashed = step, crashed
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._late: deque[float] = deque(maxlen=REMEMBERED)
        self._missed = 0

    def start(self) -> None:
        """Start the loop."""
        self._closing.clear()
        self._thread = threading.Thread(target=self._run, name=self.name, daemon=True)
        self._thread.start()

    def close(self, timeout: float = 3.0) -> bool:
        """End after the current call; return whether it has ended within ``timeout`` seconds. Idempotent."""
        self._closing.set()
        thread = self._thread
        if thread is None or thread is threading.current_thread():
            return True
        thread.join(timeout)
        return not thread.is_alive()

    def lateness(self) -> Lateness:
        """Return the delays of the last cycles."""
        late = np.array(tuple(self._late) or (0.0,))
        return Lateness(
            len(self._late), float(np.median(late)), float(np.percentile(late, 99)), float(late.max()), self._missed
        )

    def forget_lateness(self) -> None:
        """Restart the measurement."""
        self._late.clear()
        self._missed = 0

    def _run(self) -> None:
        take_real_time_priority()
        period = 1.0 / self.rate
        last = time.monotonic()
        due = last + period
        while not self._closing.is_set():
            pause = due - time.monotonic()
            if pause > 0.0:
                time.sleep(pause)
            now = time.monotonic()
            self._late.append(now - due)
            try:
                self._step(now - last)
            except Exception as error:  # noqa: BLE001 - whatever it is, the robot has to hear of it
                self._crashed(error)
                return
            last, due = now, due + period
            behind = int((time.monotonic() - due) / period)
            if behind > 0:
                self._missed += behind
                due += behind * period
