"""Exports of a run's state changes: SQLite, Chrome's trace format, JSON lines.

Times are seconds, or microseconds if the format requires them, since the run's start. Nodes of trees ticked by a leaf
have numbers after those of the main tree.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Any

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, STATUS_NAMES, SUCCESS
from bestman_bt.records.history import RunHistory
from bestman_bt.records.states import NO

_TABLES = """
CREATE TABLE IF NOT EXISTS Definitions (
    session_id INTEGER PRIMARY KEY AUTOINCREMENT, date TEXT NOT NULL, xml_tree TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS Nodes (
    session_id INTEGER NOT NULL, fullpath VARCHAR, node_uid INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS Transitions (
    timestamp INTEGER NOT NULL, session_id INTEGER NOT NULL, node_uid INTEGER NOT NULL, duration INTEGER,
    state INTEGER NOT NULL, extra_data VARCHAR);
"""


def _changes(history: RunHistory) -> Iterator[tuple[float, int, int, int]]:
    """Yield time, uid, state before and after; the answer "no" of a condition is a FAILURE here."""
    before: dict[int, int] = {}
    for change in history.states.changes():
        state = FAILURE if change.status == NO else change.status
        yield change.time, change.uid, before.get(change.uid, IDLE), state
        before[change.uid] = state


def export_sqlite(history: RunHistory, path: Path) -> None:
    """Add a session to a database with the tables of BehaviorTree.CPP's SqliteLogger.

    ``Definitions(session_id, date, xml_tree)``, ``Nodes(session_id, fullpath, node_uid)`` and ``Transitions(timestamp,
    session_id, node_uid, duration, state, extra_data)``; ``duration``: time of the node in its previous state.
    """
    started = datetime.fromtimestamp(float(history.about.get("started") or 0.0))
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(_TABLES)
        definition = (started.isoformat(" ", "seconds"), history.xml)
        session = database.execute("INSERT INTO Definitions (date, xml_tree) VALUES (?, ?)", definition).lastrowid
        nodes = [(session, node.path, node.uid) for node in history.nodes]
        database.executemany("INSERT INTO Nodes VALUES (?, ?, ?)", nodes)
        since: dict[int, float] = {}

        def rows() -> Iterator[tuple[int | None, ...]]:
            for time, uid, _, state in _changes(history):
                yield round(time * 1e6), session, uid, round((time - since.get(uid, 0.0)) * 1e6), state
                since[uid] = time

        database.executemany("INSERT INTO Transitions VALUES (?, ?, ?, ?, ?, NULL)", rows())


def export_chrome(history: RunHistory, path: Path) -> None:
    """Write a Chrome trace ("Trace Event Format"), for https://ui.perfetto.dev or chrome://tracing: a row per node.

    A slice for each time that a node was RUNNING, an instant for each result that took no time.
    """

    def events() -> Iterator[dict[str, Any]]:
        for node in history.nodes:
            yield {"ph": "M", "name": "thread_name", "tid": node.uid, "args": {"name": node.path}}
            yield {"ph": "M", "name": "thread_sort_index", "tid": node.uid, "args": {"sort_index": node.uid}}
        running: dict[int, dict[str, Any]] = {}
        for time, uid, before, state in _changes(history):
            node = history.nodes.node(uid)
            told = {"name": node.name, "cat": node.type, "tid": uid, "ts": time * 1e6}
            if state == RUNNING:
                running[uid] = told
                yield told | {"ph": "B"}
            elif before == RUNNING:
                del running[uid]
                yield told | {"ph": "E", "args": {"result": STATUS_NAMES[state]}}
            elif state in (SUCCESS, FAILURE):
                yield told | {"ph": "i", "s": "t", "name": STATUS_NAMES[state]}
        for told in running.values():
            yield told | {"ph": "E", "ts": history.last * 1e6}

    lines = ",\n".join(json.dumps({"pid": 1, **event}) for event in events())
    path.write_text(f"[{lines}]\n", encoding="utf-8")


def export_jsonl(history: RunHistory, path: Path) -> None:
    """Write ``{"time": 0.05, "uid": 3, "path": "arm/grasp", "from": "IDLE", "to": "RUNNING"}``, one line per change."""
    with path.open("w", encoding="utf-8") as file:
        for time, uid, before, state in _changes(history):
            told = {"time": time, "uid": uid, "path": history.nodes.path_of(uid)}
            file.write(json.dumps(told | {"from": STATUS_NAMES[before], "to": STATUS_NAMES[state]}) + "\n")


FORMATS: dict[str, Callable[[RunHistory, Path], None]] = {
    "chrome": export_chrome,
    "jsonl": export_jsonl,
    "sqlite": export_sqlite,
}
