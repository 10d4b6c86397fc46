"""A run that a folder holds: finished, or cut off at any moment."""

from __future__ import annotations

import asyncio
import hashlib
import heapq
import json
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import groupby
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, TypeVar, get_args

from bestman_bt.engine import EngineError
from bestman_bt.engine.logs import LoggedNode, logged_nodes, read_btlog
from bestman_bt.engine.logs.regular_file import read_regular
from bestman_bt.engine.logs.segmented_file import first_segment, read_segment
from bestman_bt.monitor.run import MonitoredRun, RunError
from bestman_bt.records.events import (
    MAIN_TREE,
    Category,
    DescribedNode,
    Event,
    EventError,
    LogEvent,
    RunEvent,
    StatesEvent,
    TreeEvent,
    from_line,
)
from bestman_bt.records.history import RunHistory
from bestman_bt.records.run_log import EVENTS_FILE, LOG_FILE, STATES_FILE, read_events, read_log

RESULT_FILE = "result.json"
PICTURES_FOLDER = "pictures"
LARGEST_FILE = 32 << 20
"""Bytes of one log that are read; executors cut theirs long before."""
LONGEST_FIRST_LINE = 64 << 10
LARGEST_RESULT = 1 << 20
LARGEST_PICTURE = 8 << 20
_CATEGORIES: dict[str, Category] = {name: name for name in get_args(Category)}
Told = TypeVar("Told", bound=Event)
MOST_FAULTS = 20
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png")


def run_folders(given: Path) -> list[Path]:
    """The run folders that a path means: itself, or those in it."""
    if _is_run(given):
        return [given]
    return sorted(path for path in given.iterdir() if _is_run(path)) if given.is_dir() else []


def identity_of(folder: Path) -> str:
    """The id of a recorded run: the same in each monitor, so that a page finds it again."""
    return f"run-{hashlib.sha256(str(folder.absolute()).encode()).hexdigest()[:12]}"


def _is_run(folder: Path) -> bool:
    return (folder / STATES_FILE).is_file() or (folder / EVENTS_FILE).is_file()


class RecordedRun(MonitoredRun):
    """The history is read when somebody opens the run, in a thread of its own, and may be unloaded afterwards."""

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
        """``ended``; ``interrupted`` where neither a result nor an end is recorded."""
        return "ended" if self._result or self.history.end else "interrupted"

    def summary(self) -> dict[str, Any]:
        """Before the run is opened, its duration is known from the result."""
        told, duration = super().summary(), self._result.get("sim_time_s")
        if not self.is_loaded and isinstance(duration, int | float):
            told["time"] = duration
        return told

    def look(self) -> None:
        """Read what lists tell: the result and the first event. What is damaged is told when the run is opened."""
        self._result, self._fault = {}, ""
        try:
            self._result = read_result(self.folder)
        except RunError as error:
            self._fault = str(error)
        first = _first_event(self.folder)
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
        """Hold only what lists tell."""
        self.is_loaded = False
        self.history = self._empty()

    def _empty(self) -> RunHistory:
        history = RunHistory()
        if self._about is not None:
            history.take(self._about)
        if self._result:
            history.end = {key: self._result.get(key) for key in ("outcome", "tree_status")}
        return history

    async def open(self) -> None:
        """Read the folder, if that was not done yet; raises RunError where it cannot be read."""
        async with self._loading:
            self.opened = time.monotonic()
            if not self.is_loaded:
                self.look()
                history = self._empty()
                await asyncio.to_thread(read_into, history, self.folder)
                if self._fault:
                    history.take(LogEvent(history.last, "warning", self._fault, logger="monitor"))
                self.history, self.is_loaded = history, True

    async def request(self, message: dict[str, Any]) -> dict[str, Any]:
        """Refused: it is over."""
        raise RunError("the run is over; only the page's own time can be moved")

    async def picture(self, number: int) -> bytes:
        """A picture of the folder."""
        found = self.history.picture(number)
        if found is None:
            raise RunError("there is no such picture")
        return found.jpeg or await asyncio.to_thread(read_picture, self.folder, found.file)


def read_into(history: RunHistory, folder: Path) -> None:
    """Add all that a run folder tells to ``history``; what is damaged or missing is told in its log.

    Raises:
        RunError: it is no run folder, or nothing in it can be read.
    """
    if not _is_run(folder):
        raise RunError(f"{folder} is no run folder: it has neither {STATES_FILE} nor {EVENTS_FILE}")
    faults = _Faults()
    told = list(faults.until(EVENTS_FILE, read_events(folder))) if _has(folder, EVENTS_FILE, faults) else []
    log = list(faults.until(LOG_FILE, read_log(folder))) if _has(folder, LOG_FILE, faults) else []
    states: Iterable[Event] = ()
    gaps: list[Event] = []
    rates = [event.tick_rate for event in told if isinstance(event, RunEvent)]
    if _has(folder, STATES_FILE, faults):
        try:
            tree, states, gaps = _states(folder, rates[0] if rates else 0.0)
        except (OSError, EngineError) as error:
            faults.add(f"{STATES_FILE} cannot be read: {error}")
        else:
            if not any(isinstance(event, TreeEvent) and event.tree == MAIN_TREE for event in told):
                told.insert(0, tree)
    if faults.words and not (told or log):
        raise RunError(f"{folder.name} cannot be read: {'; '.join(faults.words)}")
    for _, event in heapq.merge(_timed(told), _timed(states), _timed(gaps), _timed(log), key=itemgetter(0)):
        try:
            history.take(replace(event, folder=str(folder)) if isinstance(event, RunEvent) else event)
        except (ValueError, TypeError, OverflowError) as error:
            faults.add(f"an event does not fit the run: {error}")
    for words in faults.words:
        history.take(LogEvent(history.last, "warning", words, logger="monitor"))


class _Faults:
    """``words``: what could not be read, the first ones."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def add(self, words: str) -> None:
        if len(self.words) < MOST_FAULTS:
            self.words.append(words)

    def until(self, name: str, events: Iterator[Told]) -> Iterator[Told]:
        """The events up to a damaged one."""
        try:
            yield from events
        except (OSError, EngineError, EventError) as error:
            self.add(f"{name} cannot be read to its end: {error}")


def _has(folder: Path, name: str, faults: _Faults) -> bool:
    """Whether there is such a log, of a size that is read."""
    path = folder / name
    try:
        size = (path if path.exists() else first_segment(path)).stat().st_size
    except FileNotFoundError:
        return False
    except OSError as error:
        faults.add(f"{name} cannot be read: {error}")
        return False
    if size > LARGEST_FILE:
        faults.add(f"{name} has {size} bytes; at most {LARGEST_FILE} are read")
    return size <= LARGEST_FILE


def _states(folder: Path, tick_rate: float) -> tuple[TreeEvent, Iterator[Event], list[Event]]:
    """The main tree, its states, one event for all changes of one moment, and warnings of where some are missing.

    Logs do not number ticks: where the rate is known, they are reckoned from the time.
    """
    log = read_btlog(folder / STATES_FILE)
    nodes = [_described(node) for node in logged_nodes(log.xml, STATES_FILE)]
    gaps: list[Event] = [
        LogEvent(begin, "warning", f"the states from {begin:.1f} s to {end:.1f} s were not read", logger="monitor")
        for begin, end in log.gaps
    ]

    def states() -> Iterator[Event]:
        for number, (stamp, group) in enumerate(groupby(log.transitions, key=attrgetter("time")), 1):
            tick = round(stamp * tick_rate) + 1 if tick_rate > 0 else number
            yield StatesEvent(stamp, tick, [(change.uid, change.status) for change in group])

    return TreeEvent(nodes, log.xml, ""), states(), gaps


def _described(node: LoggedNode) -> DescribedNode:
    category = _CATEGORIES.get(node.category, "action")
    scope = node.path.rpartition("/")[0]
    return DescribedNode(node.uid, node.parent, node.name, node.type, category, node.path, node.ports, scope)


def _timed(events: Iterable[Event]) -> Iterator[tuple[float, Event]]:
    """Events without a time happen with the one before."""
    now = -math.inf
    for event in events:
        now = max(now, getattr(event, "time", now))
        yield now, event


def _first_event(folder: Path) -> Event | None:
    try:
        line, newline, _ = read_segment(first_segment(folder / EVENTS_FILE), LONGEST_FIRST_LINE).partition(b"\n")
        return from_line(line) if newline else None
    except (OSError, EventError):
        return None


def read_result(folder: Path) -> dict[str, Any]:
    """``result.json``; empty where there is none. Raises RunError for a damaged one."""
    path = folder / RESULT_FILE
    try:
        if not path.is_file():
            return {}
        result = json.loads(read_regular(path, LARGEST_RESULT))
    except (OSError, ValueError, RecursionError) as error:
        raise RunError(f"{RESULT_FILE} cannot be read: {error}") from error
    if not isinstance(result, dict):
        raise RunError(f"{RESULT_FILE} holds no result")
    return result


def read_picture(folder: Path, name: str) -> bytes:
    """A picture that an event of this folder names; raises RunError for anything that is not one inside of it."""
    try:
        inside = folder.resolve() / PICTURES_FOLDER  # not resolved itself: it may be a link that leads elsewhere
        path = (folder / name).resolve()
        if not path.is_relative_to(inside) or path.suffix.lower() not in PICTURE_SUFFIXES:
            raise RunError("the run names a file that is no picture of its own")
        return read_regular(path, LARGEST_PICTURE)
    except (OSError, ValueError) as error:
        raise RunError(f"the picture cannot be read: {error}") from error


def _modified(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0
