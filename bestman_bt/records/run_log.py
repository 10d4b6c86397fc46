"""The events of a run in its folder: written while it goes on, read afterwards or meanwhile.

``transitions.btlog`` has the states of the main tree, ``log.jsonl`` the log in the keys of structlog, and
``events.jsonl`` all else. All three are cut into segments, see ``bestman_bt.engine.logs.segmented_file``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import get_args

from bestman_bt.engine import Tree
from bestman_bt.engine.logs.btlog import BtLogWriter
from bestman_bt.engine.logs.segmented_file import SegmentedFile, read_segments
from bestman_bt.records.events import (
    MAIN_TREE,
    Event,
    EventError,
    ImageEvent,
    Level,
    LogEvent,
    RobotEvent,
    RunEvent,
    ScanEvent,
    StatesEvent,
    from_line,
    to_line,
)

STATES_FILE, EVENTS_FILE, LOG_FILE = "transitions.btlog", "events.jsonl", "log.jsonl"
SEGMENT = 4 << 20
"""Bytes of events, or of log lines, after which a new segment begins."""
KEEP_EVENTS, KEEP_LOG = 64 << 20, 16 << 20
"""Compressed bytes of full segments that are kept."""
LONGEST_SEGMENT = 4 * SEGMENT
MOST_READ = 64 << 20
"""Bytes that are read of one full segment, and of all together."""
KEPT_EVERY = {"robot": 0.19, "scan": 1.9}
"""Seconds between those that are kept: of robot states that come each 0.1 s every other."""

_LEVELS = get_args(Level)


class RunLogWriter:
    """Writes the events of one execution into ``folder``; from one thread."""

    def __init__(self, folder: Path, tree: Tree, run: RunEvent) -> None:
        self._started = run.started
        self._states = BtLogWriter(tree, folder / STATES_FILE, start=run.started, listen=False).open()
        self._events = SegmentedFile(folder / EVENTS_FILE, segment=SEGMENT, keep=KEEP_EVENTS)
        self._log = SegmentedFile(folder / LOG_FILE, segment=SEGMENT, keep=KEEP_LOG)
        self._said: dict[int, str] = {}
        self._due: dict[str, float] = {}
        self.flush()

    def write(self, event: Event) -> None:
        """Add an event."""
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
        """Hand everything to the operating system: what was flushed survives the end of the process."""
        for file in (self._states, self._events, self._log):
            file.flush()

    def close(self) -> None:
        """End the log."""
        for file in (self._states, self._events, self._log):
            file.close()

    def _log_line(self, event: LogEvent) -> bytes:
        when = datetime.fromtimestamp(self._started + event.time, UTC)
        words = {name: value for name, value in asdict(event).items() if value != ""}
        del words["message"]
        stamp = when.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        line = {**words, "timestamp": stamp, "event": event.message}
        return json.dumps(line, ensure_ascii=False).encode() + b"\n"


def read_events(folder: Path) -> Iterator[Event]:
    """The events of ``events.jsonl`` and its earlier segments, in order; a torn last line is left out.

    Where segments are missing, or left out because there are too many, a warning says so.

    Raises:
        EventError: the folder has no such file, or a line is no event.
    """
    time = 0.0
    for number, line in _lines(folder / EVENTS_FILE):
        if line is None:
            yield _left_out(time, EVENTS_FILE)
            continue
        try:
            event = from_line(line)
            time = getattr(event, "time", time)
            yield event
        except EventError as error:
            raise EventError(f"{folder / EVENTS_FILE}: line {number}: {error}") from error


def read_log(folder: Path) -> Iterator[LogEvent]:
    """The lines of ``log.jsonl`` and its earlier segments; raises as ``read_events``."""
    time = 0.0
    for number, line in _lines(folder / LOG_FILE):
        if line is None:
            yield _left_out(time, LOG_FILE)
            continue
        try:
            document = json.loads(line)
            level = document["level"]
            if level not in _LEVELS:
                raise ValueError(f"the level {level!r}")
            time = float(document["time"])
            yield LogEvent(
                time,
                level,
                str(document["event"]),
                str(document.get("node", "")),
                str(document.get("code", "")),
                str(document.get("logger", "tree")),
                str(document.get("where", "")),
            )
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise EventError(f"{folder / LOG_FILE}: line {number}: no line of a log: {error!r}") from error


def _left_out(time: float, file: str) -> LogEvent:
    return LogEvent(time, "warning", f"a part of {file} that follows here was not read", logger="monitor")


def _lines(path: Path) -> Iterator[tuple[int, bytes | None]]:
    """The whole lines of a file and its earlier segments, numbered as they are read; None where some are missing."""
    number = 0
    try:
        segments = read_segments(path, MOST_READ, LONGEST_SEGMENT)
    except OSError as error:
        raise EventError(f"{path} cannot be read: {error}") from error
    for segment in segments:
        if segment.is_after_gap:
            yield number, None
        for line in segment.data.splitlines(keepends=True):
            number += 1
            if line.endswith(b"\n"):
                yield number, line
