"""The writer of a run's events into its folder; ``bestman_bt.records.reader`` reads them.

``transitions.btlog`` has the states of the main tree, ``log.jsonl`` the log with the keys of structlog, and
``events.jsonl`` everything else. All three are split into segments, see ``bestman_bt.engine.logs.segmented_file``.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path

from bestman_bt.engine import Tree
from bestman_bt.engine.logs.btlog import BtLogWriter
from bestman_bt.engine.logs.segmented_file import SegmentedFile
from bestman_bt.records.events import (
    MAIN_TREE,
    Event,
    ImageEvent,
    LogEvent,
    RobotEvent,
    RunEvent,
    ScanEvent,
    StatesEvent,
    to_line,
)

STATES_FILE, EVENTS_FILE, LOG_FILE = "transitions.btlog", "events.jsonl", "log.jsonl"
RESULT_FILE, CONFIG_FILE = "result.json", "config.yaml"
SEGMENT = 4 << 20
"""Bytes of events, or of log lines, after which a new segment begins."""
KEEP_EVENTS, KEEP_LOG = 64 << 20, 16 << 20
"""Compressed bytes of full segments to keep."""
KEPT_EVERY = {"robot": 0.19, "scan": 1.9}
"""Seconds between stored robot states: every second one of those that arrive every 0.1 s."""


def make_folder(parent: Path, stem: str) -> Path:
    """Create a new folder for a run, with a number if the name exists.

    Raises OSError if ``parent`` is not usable.
    """
    for number in count(1):
        folder = parent / (stem if number == 1 else f"{stem}-{number}")
        with suppress(FileExistsError):
            folder.mkdir(parents=True)
            break
    return folder


class RunLogWriter:
    """Writes the events of one execution into ``folder``, from one thread. ``tree``: as for ``BtLogWriter``."""

    def __init__(self, folder: Path, tree: Tree | str, run: RunEvent) -> None:
        self._started = run.started
        self._states = BtLogWriter(tree, folder / STATES_FILE, start=run.started, listen=False).open()
        self._events = SegmentedFile(folder / EVENTS_FILE, segment=SEGMENT, keep=KEEP_EVENTS)
        self._log = SegmentedFile(folder / LOG_FILE, segment=SEGMENT, keep=KEEP_LOG)
        self._said: dict[int, str] = {}
        self._due: dict[str, float] = {}
        self.flush()

    def write(self, event: Event) -> None:
        """Append an event to the log."""
        if isinstance(event, LogEvent):
            self._log.write(self._log_line(event))
            return
        if isinstance(event, ImageEvent) and not event.file:
            return
        if isinstance(event, (RobotEvent, ScanEvent)):
            if event.time < self._due.get(event.event, 0.0):
                return
            self._due[event.event] = event.time + KEPT_EVERY[event.event]
        if isinstance(event, StatesEvent) and event.tree == MAIN_TREE:
            self._states.write(event.time, event.changes)
            news = {uid: text for uid, text in event.messages.items() if self._said.get(uid) != text}
            if not news:
                return
            self._said.update(news)
            event = replace(event, changes=[], messages=news)
        self._events.write(to_line(event))

    def flush(self) -> None:
        """Flush all files to the operating system, so that they survive the end of the process."""
        for file in (self._states, self._events, self._log):
            file.flush()

    def close(self) -> None:
        """End the log."""
        for file in (self._states, self._events, self._log):
            file.close()

    def _log_line(self, event: LogEvent) -> bytes:
        when = datetime.fromtimestamp(self._started + event.time, UTC)
        words = {name: value for name, value in asdict(event).items() if value not in ("", None)}
        del words["message"]
        stamp = when.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        line = {**words, "timestamp": stamp, "event": event.message}
        return json.dumps(line, ensure_ascii=False).encode() + b"\n"
