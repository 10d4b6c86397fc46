"""The black box: keeps the last minute of commands and measurements of all parts, and saves it when the robot stops."""

from __future__ import annotations

import logging
import math
import os
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.black_box import PATTERN, BlackBox, PartTrace

SPAN = 60.0
"""Seconds that are kept."""
AFTERWARDS = 0.7
"""Seconds after a stop to record as well, in which the parts come to rest."""
HIGHEST_RATE = 500.0
"""Rows per second; limits the memory for parts with a higher control rate."""
ROWS = 1000
"""Number of rows of a block."""
MOST_REASONS = 200
MOST_FILES = 20
"""Maximum number of files per run."""


@dataclass(eq=False)
class _Block:
    times: NDArray[np.float64]
    values: NDArray[np.float32]
    used: int = 0


class Trace:
    """The last ``SPAN`` seconds of one part, a row of numbers per control period; written by one thread.

    ``fault``: why its motion has failed, until it has been handled.
    """

    def __init__(self, columns: tuple[str, ...], now: Callable[[], float]) -> None:
        self.columns, self._now = columns, now
        self._blocks: deque[_Block] = deque()
        self._reasons: deque[tuple[float, str]] = deque(maxlen=MOST_REASONS)
        self._reason = ""
        self._last = -math.inf
        self.fault = ""

    def row(self) -> NDArray[np.float32] | None:
        """Return the next row (C,) for the caller to fill immediately, or None if the last row is too recent."""
        now = self._now()
        if now - self._last < 0.9 / HIGHEST_RATE:
            return None
        self._last = now
        block = self._blocks[-1] if self._blocks else None
        if block is None or block.used == ROWS:
            block = self._next_block(now)
        block.times[block.used] = now
        row: NDArray[np.float32] = block.values[block.used]
        block.used += 1
        return row

    def latest(self) -> NDArray[np.float32] | None:
        """Return the last row (C,), None before the first."""
        block = self._blocks[-1] if self._blocks else None
        return None if block is None else block.values[block.used - 1].copy()

    def note(self, reason: str) -> None:
        """Record why the gate holds back set-points; empty if it does not. A text that differs only in its numbers is
        not a new reason."""
        kind = reason.partition("=")[0]
        if kind != self._reason:
            self._reason = kind
            self._reasons.append((self._now(), reason))

    def taken(self) -> PartTrace:
        """Return a copy of the trace."""
        blocks = [(block, block.used) for block in tuple(self._blocks)]
        times = np.concatenate([np.empty(0), *(block.times[:used] for block, used in blocks)])
        empty = np.empty((0, len(self.columns)), np.float32)
        values = np.concatenate([empty, *(block.values[:used] for block, used in blocks)])
        kept = times >= self._now() - SPAN - AFTERWARDS
        return PartTrace(times[kept], values[kept], self.columns, tuple(self._reasons))

    def _next_block(self, now: float) -> _Block:
        """Return a block that is too old to be kept, else a new one."""
        first = self._blocks[0] if len(self._blocks) > 1 else None
        if first is not None and first.times[ROWS - 1] < now - SPAN - AFTERWARDS:
            self._blocks.popleft()
            block = _Block(first.times, first.values)
        else:
            block = _Block(np.empty(ROWS), np.empty((ROWS, len(self.columns)), np.float32))
        self._blocks.append(block)
        return block


@dataclass(eq=False)
class StopRecorder:
    """Writes the ``traces`` of all parts into a folder, ``AFTERWARDS`` seconds after each stop and failed motion.

    ``background``: write in a separate thread without the priority of the control loop.
    """

    traces: Mapping[str, Trace]
    now: Callable[[], float]
    background: bool = False
    _taking: threading.Lock = field(default_factory=threading.Lock)
    _writing: threading.Thread | None = None
    _folder: Path | None = None
    _stopped: tuple[float, str] | None = None
    _count: int = 0

    def keep_in(self, folder: Path | None) -> None:
        """Set the folder of the files; None: write none. Pending data are written first."""
        self.flush()
        if folder != self._folder:
            self._folder, self._count = folder, 0

    def stopped(self, reason: str) -> None:
        """Schedule a file after a stop of the robot or a failed motion."""
        if self._folder is not None and self._stopped is None and self._count < MOST_FILES:
            self._stopped = (self.now(), reason)

    @property
    def due_in(self) -> float:
        """Return the seconds until a file is due; 0 if none is pending."""
        return 0.0 if self._stopped is None else max(0.0, self._stopped[0] + AFTERWARDS - self.now())

    def look(self) -> None:
        """Write the file if it is due; called every few milliseconds."""
        for name, trace in self.traces.items():
            if trace.fault:
                self.stopped(f"{name}: {trace.fault}")
                trace.fault = ""
        if self._stopped is not None and self.due_in == 0.0:
            self._write()

    def flush(self) -> None:
        """Write a pending file now."""
        self._write()
        with self._taking:
            writing = self._writing
        if writing is not None:
            writing.join()

    def _write(self) -> None:
        with self._taking:
            stopped, folder, self._stopped = self._stopped, self._folder, None
            if stopped is None or folder is None:
                return
            self._count += 1
            before = self._writing

            def save() -> None:
                if before is not None:
                    before.join()
                parts = {name: trace.taken() for name, trace in self.traces.items()}
                try:
                    number = 1 + len(list(folder.glob(PATTERN)))  # of another process, too
                    BlackBox(*stopped, parts).save(folder / f"black_box_{number}.npz")
                except OSError as error:
                    logging.getLogger(__name__).warning("no black box was written: %s", error)

            if self.background:
                thread = threading.Thread(target=_without_priority, args=(save,), name="black box", daemon=True)
                thread.start()
                self._writing = thread  # once it has begun: another thread may join it at once
                return
        save()


def _without_priority(task: Callable[[], None]) -> None:
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    task()
