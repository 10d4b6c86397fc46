"""A run in a folder: finished, or interrupted at any moment."""

from __future__ import annotations

import asyncio
import hashlib
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from bestman_bt.monitor.run import MonitoredRun, RunError
from bestman_bt.records.events import LogEvent, RunEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import RecordError, first_event, read, read_picture, read_result


def identity_of(folder: Path) -> str:
    """Return the id of a recorded run: the same in each monitor, so that a page finds it again."""
    return f"run-{hashlib.sha256(str(folder.absolute()).encode()).hexdigest()[:12]}"


class RecordedRun(MonitoredRun):
    """A recorded run. Its history is read in a separate thread when a page opens it, and may be unloaded later."""

    kind = "recorded"

    def __init__(self, identity: str, folder: Path) -> None:
        super().__init__(identity)
        self.folder = folder
        self.is_loaded = False
        self.opened = 0.0
        self._result: dict[str, Any] = {}
        self._fault = ""
        self._about: RunEvent | None = None
        self._loading = asyncio.Lock()

    @property
    def state(self) -> str:
        """Return ``ended``, or ``interrupted`` if neither a result nor an end is recorded."""
        return "ended" if self._result or self.history.end else "interrupted"

    def summary(self) -> dict[str, Any]:
        """Return the summary; before the run is opened its duration is that of the result."""
        told, duration = super().summary(), self._result.get("sim_time_s")
        if not self.is_loaded and isinstance(duration, int | float):
            told["time"] = duration
        return told

    def look(self) -> None:
        """Read the result and the first event, for lists. Damage is reported when the run is opened."""
        self._result, self._fault = {}, ""
        try:
            self._result = read_result(self.folder)
        except RecordError as error:
            self._fault = str(error)
        first = first_event(self.folder)
        if isinstance(first, RunEvent):
            self._about = replace(first, folder=str(self.folder))
        else:
            task, seed = str(self._result.get("task") or self.folder.name), self._result.get("seed")
            started = _modified(self.folder)
            self._about = RunEvent(
                task, "", "", "", seed if isinstance(seed, int) else 0, str(self.folder), 0, started, 0.0, "simulated"
            )
        self.unload()

    def unload(self) -> None:
        """Discard the history; keep only the summary for lists."""
        self.is_loaded = False
        self.history = self._with_result(RunHistory())

    def _with_result(self, history: RunHistory) -> RunHistory:
        if self._about is not None and "task" not in history.about:
            history.take(self._about)
        if self._result and history.end is None:
            history.end = {key: self._result.get(key) for key in ("outcome", "tree_status")}
        return history

    async def open(self) -> None:
        """Read the folder unless it is loaded. Raises RunError if it cannot be read."""
        async with self._loading:
            self.opened = time.monotonic()
            if not self.is_loaded:
                self.look()
                history = self._with_result(await asyncio.to_thread(read_run, self.folder))
                if self._fault:
                    history.take(LogEvent(history.last, "warning", self._fault, logger="monitor"))
                self.history, self.is_loaded = history, True

    async def request(self, message: dict[str, Any]) -> dict[str, Any]:
        """Refuse every request: the run has ended."""
        raise RunError("the run is over; only the page's own time can be moved")

    async def picture(self, number: int) -> bytes:
        """Return a picture of the folder."""
        found = self.history.picture(number)
        if found is None:
            raise RunError("there is no such picture")
        try:
            return found.jpeg or await asyncio.to_thread(read_picture, self.folder, found.file)
        except RecordError as error:
            raise RunError(str(error)) from error


def read_run(folder: Path) -> RunHistory:
    """Read a run folder; damaged or missing parts are reported in its log.

    Raises:
        RunError: the folder is not a run folder, or none of it can be read.
    """
    try:
        history = read(folder)
    except RecordError as error:
        raise RunError(str(error)) from error
    for words in history.faults:
        history.take(LogEvent(history.last, "warning", words, logger="monitor"))
    return history


def _modified(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0
