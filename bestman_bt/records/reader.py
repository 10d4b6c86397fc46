"""Reader of the record of a run from its folder, in any state, or from a log of BehaviorTree.CPP."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.logs.btlog import BtLog, Transitions, read_btlog
from bestman_bt.engine.logs.segmented_file import first_segment, read_regular, read_segment, read_segments
from bestman_bt.engine.logs.sqlite_log import is_sqlite, read_sqlite
from bestman_bt.engine.status import FAILURE, SUCCESS
from bestman_bt.errors import InputError
from bestman_bt.records.described_tree import describe_xml
from bestman_bt.records.events import (
    MAIN_TREE,
    EndEvent,
    Event,
    EventError,
    LogEvent,
    RunEvent,
    StatesEvent,
    TreeEvent,
    from_line,
    from_log_line,
)
from bestman_bt.records.history import RunHistory
from bestman_bt.records.writer import EVENTS_FILE, LOG_FILE, RESULT_FILE, SEGMENT, STATES_FILE

LONGEST_SEGMENT = 4 * SEGMENT
MOST_READ = 512 << 20
"""Largest number of bytes read from all segments together, more than ten hours; one segment is in memory at a time."""
RECORDS = (STATES_FILE, EVENTS_FILE)
LARGEST_FILE = 32 << 20
"""Largest number of bytes read from one log; executors split theirs much earlier."""
LOG_SUFFIXES = (".btlog", ".db3", ".btdb")
LONGEST_FIRST_LINE = 64 << 10
LARGEST_PICTURE, LARGEST_RESULT = 8 << 20, 4 << 20
PICTURES_FOLDER = "pictures"
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png")
MOST_FAULTS, LONGEST_FAULT = 20, 300
OUTCOMES = {SUCCESS: "success", FAILURE: "failure"}
"""Outcome of a tree without a judge, by the last result of its root."""


class RecordError(InputError):
    """A record, or a part of it, cannot be read."""


def is_log(path: Path) -> bool:
    """Return whether the name of a file is that of a BehaviorTree.CPP log."""
    return path.suffix in LOG_SUFFIXES and path.is_file()


def has_record(folder: Path) -> bool:
    """Return whether a folder has states or events of a run."""
    return _has_one(folder, RECORDS)


def run_folders(
    given: Path, parts: Collection[str] = RECORDS, depth: int = 1, known: Collection[str] = ()
) -> list[Path]:
    """Return the run folders of a path: itself, those at most ``depth`` folders below it, or a log of BehaviorTree.CPP.

    A run folder has one of the files ``parts``. Links to run folders count; other links are not followed. Paths in
    ``known`` are skipped without reading them.
    """
    if str(given) in known:
        return []
    return [given] if is_log(given) else list(_below(given, parts, depth, known))


def _below(folder: Path, parts: Collection[str], depth: int, known: Collection[str]) -> Iterator[Path]:
    if _has_one(folder, parts):
        yield folder
    elif depth and folder.is_dir():
        with os.scandir(folder) as entries:
            unknown = sorted(folder / entry.name for entry in entries if entry.path not in known)
        for inner in unknown:
            yield from _below(inner, parts, 0 if inner.is_symlink() else depth - 1, known)


def _has_one(folder: Path, parts: Collection[str]) -> bool:
    return any((folder / part).is_file() for part in parts)


def read(path: Path, skip: Collection[str] = ()) -> RunHistory:
    """Return the history of a run folder or of a log of BehaviorTree.CPP; damaged parts are listed in ``faults``.

    ``skip``: kinds of events to skip, such as the frequent ``robot``.

    Raises:
        RecordError: it is not a run folder, or nothing can be read.
    """
    states = path if path.is_file() else path / STATES_FILE
    if not (path.is_file() or has_record(path)):
        raise RecordError(f"{path} is not a run folder: it has neither {STATES_FILE} nor {EVENTS_FILE}")
    history, changes, log = RunHistory(), _Changes(), None
    if _is_read(states, history.faults):
        try:
            log = read_sqlite(states) if path.is_file() and is_sqlite(states) else read_btlog(states)
        except (OSError, EngineError) as error:
            _add_fault(history.faults, states.name, error)
    if not path.is_file() and _is_read(path / EVENTS_FILE, history.faults):
        _take_all(history, EVENTS_FILE, _events(history, path, log, changes, skip))
    if log is not None:
        _take_states(history, log, states.name, changes)
    if changes.changes:
        found, ticks = changes.sorted()
        history.add_changes(history.with_answers(found), ticks)
    if not path.is_file() and _is_read(path / LOG_FILE, history.faults):
        _take_all(history, LOG_FILE, read_log(path))
    if path.is_file() and len(history.states.now) and (outcome := OUTCOMES.get(int(history.states.now.results[1]))):
        history.take(EndEvent(history.last, outcome, outcome.upper(), "the end of the log"))
    if history.faults and not history.version:
        raise RecordError(f"{path.name} cannot be read: {'; '.join(history.faults)}")
    return history


class _Changes:
    """Changes of state from several files, with the tick of each."""

    def __init__(self) -> None:
        self.changes: list[Transitions] = []
        self.ticks: list[NDArray[np.int64]] = []

    def add(self, changes: Transitions, ticks: NDArray[np.int64]) -> None:
        self.changes.append(changes)
        self.ticks.append(ticks)

    def sorted(self) -> tuple[Transitions, NDArray[np.int64]]:
        """Return all, in the order of time."""
        found, ticks = self.changes[0], self.ticks[0]
        if len(self.changes) > 1:
            found, ticks = Transitions.joined(self.changes), np.concatenate(self.ticks)
        if (found.times[1:] >= found.times[:-1]).all():
            return found, ticks
        order = np.argsort(found.times, kind="stable")
        return Transitions(found.times[order], found.uids[order], found.statuses[order]), ticks[order]


def _events(
    history: RunHistory, folder: Path, log: BtLog | None, changes: _Changes, skip: Collection[str]
) -> Iterator[Event]:
    """Yield all events except changes of state, which are added to ``changes``; the main tree precedes events that name
    its nodes.
    """
    for event in read_events(folder, skip):
        names_nodes = isinstance(event, StatesEvent) or (isinstance(event, TreeEvent) and event.tree != MAIN_TREE)
        if log is not None and names_nodes and MAIN_TREE not in history.nodes.trees:
            yield describe_xml(log.xml, STATES_FILE)
        if isinstance(event, RunEvent):
            event = replace(event, folder=str(folder))
        elif isinstance(event, StatesEvent) and event.changes and event.tree in history.nodes.trees:
            offset, count = history.nodes.range_of(event.tree)
            found = [(offset + uid, state) for uid, state in event.changes if 0 < uid <= count]
            uids, states = np.array(found, dtype=np.uint32).reshape(-1, 2).T
            moments = np.full(len(uids), event.time)
            changes.add(Transitions(moments, uids, states.astype(np.uint8)), np.full(len(uids), event.tick))
            if not event.messages:
                continue
            event = replace(event, changes=[])
        yield event


def _take_all(history: RunHistory, name: str, events: Iterator[Event]) -> None:
    """Add events up to a damaged line; one that does not fit is skipped."""
    try:
        for event in events:
            try:
                history.take(event)
            except (ValueError, TypeError, OverflowError) as error:
                _add_fault(history.faults, name, f"an event does not fit the run: {error}")
    except (OSError, EngineError, EventError) as error:
        _add_fault(history.faults, name, error)


def _take_states(history: RunHistory, log: BtLog, name: str, changes: _Changes) -> None:
    """Add the changes of the main tree, and warnings if some are missing.

    Logs do not number ticks: they are computed from the time if the rate is known.
    """
    if MAIN_TREE not in history.nodes.trees:
        try:
            history.take(describe_xml(log.xml, name))
        except (EngineError, EventError) as error:
            _add_fault(history.faults, name, error)
            return
    history.about.setdefault("started", log.start)
    offset, count = history.nodes.range_of(MAIN_TREE)
    found = log.transitions
    known = (found.uids > 0) & (found.uids <= count)
    if not known.all():
        found = Transitions(found.times[known], found.uids[known], found.statuses[known])
    rate = float(history.about.get("tick_rate") or 0.0)
    if rate > 0:
        ticks = np.round(found.times * rate).astype(np.int64) + 1
    else:
        ticks = np.cumsum(np.append(True, found.times[1:] != found.times[:-1])[: len(found)])
    changes.add(Transitions(found.times, found.uids.astype(np.uint32) + offset, found.statuses), ticks)
    for begin, end in log.gaps:
        words = f"the states from {begin:.1f} s to {end:.1f} s were not read"
        history.take(LogEvent(begin, "warning", words, logger=__name__))


def _is_read(path: Path, faults: list[str]) -> bool:
    """Return whether there is such a log, of a size that is read."""
    try:
        size = (path if path.exists() else first_segment(path)).stat().st_size
    except FileNotFoundError:
        return False
    except OSError as error:
        _add_fault(faults, path.name, error)
        return False
    if size > LARGEST_FILE:
        _add_fault(faults, path.name, f"it has {size} bytes; at most {LARGEST_FILE} are read")
    return size <= LARGEST_FILE


def _add_fault(faults: list[str], name: str, why: object) -> None:
    if len(faults) < MOST_FAULTS:
        words = str(why).splitlines() or [type(why).__name__]
        faults.append(f"{name} was not read to its end: {words[0][:LONGEST_FAULT]}")


def first_event(folder: Path) -> Event | None:
    """Return the first event of a run, or None if it cannot be read."""
    try:
        line, newline, _ = read_segment(first_segment(folder / EVENTS_FILE), LONGEST_FIRST_LINE).partition(b"\n")
        return from_line(line) if newline else None
    except (OSError, EventError):
        return None


def read_result(folder: Path) -> dict[str, Any]:
    """Return the document of ``result.json``; empty if a run has none yet. Raises RecordError for a damaged one."""
    path = folder / RESULT_FILE
    try:
        if not path.is_file():
            return {}
        result = json.loads(read_regular(path, LARGEST_RESULT))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordError(f"{RESULT_FILE} cannot be read: {error}") from error
    if not isinstance(result, dict):
        raise RecordError(f"{RESULT_FILE} holds no result: it is not a JSON object")
    return result


def read_picture(folder: Path, name: str) -> bytes:
    """Return a picture that an event of this folder names; raises RecordError for any other file, or one outside the
    folder.
    """
    try:
        inside = folder.resolve() / PICTURES_FOLDER  # not resolved itself: it may be a link that leads elsewhere
        path = (folder / name).resolve()
        if not path.is_relative_to(inside) or path.suffix.lower() not in PICTURE_SUFFIXES:
            raise RecordError("the run names a file that is not one of its pictures")
        return read_regular(path, LARGEST_PICTURE)
    except (OSError, ValueError) as error:
        raise RecordError(f"the picture cannot be read: {error}") from error


def read_events(folder: Path, skip: Collection[str] = ()) -> Iterator[Event]:
    """Yield the events of ``events.jsonl`` and its earlier segments, in order, without a torn last line.

    ``skip``: kinds to skip. Logs a warning if segments are missing or skipped.

    Raises:
        EventError: the folder has no such file, or a line is not an event.
    """
    time, skipped = 0.0, tuple(f'"event":"{kind}"}}\n'.encode() for kind in skip)
    for number, line in _lines(folder / EVENTS_FILE):
        if line is None:
            yield _left_out(time, EVENTS_FILE)
            continue
        if line.endswith(skipped):  # as ``to_line`` writes them
            continue
        try:
            event = from_line(line)
            time = getattr(event, "time", time)
            if event.event not in skip:
                yield event
        except EventError as error:
            raise EventError(f"{folder / EVENTS_FILE}: line {number}: {error}") from error


def read_log(folder: Path) -> Iterator[LogEvent]:
    """Yield the lines of ``log.jsonl`` and its earlier segments. Raises EventError for an invalid line."""
    time = 0.0
    for number, line in _lines(folder / LOG_FILE):
        if line is None:
            yield _left_out(time, LOG_FILE)
            continue
        try:
            event = from_log_line(line)
        except EventError as error:
            raise EventError(f"{folder / LOG_FILE}: line {number}: {error}") from error
        time = event.time
        yield event


def _left_out(time: float, file: str) -> LogEvent:
    return LogEvent(time, "warning", f"a part of {file} that follows here was not read", logger=__name__)


def _lines(path: Path) -> Iterator[tuple[int, bytes | None]]:
    """Yield the whole lines of a file and its earlier segments, numbered; None where some are missing."""
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
