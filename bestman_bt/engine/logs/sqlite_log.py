"""Logs of BehaviorTree.CPP's SqliteLogger, ``.db3`` or ``.btdb``; ``bestman-bt export`` writes them, too."""

from __future__ import annotations

import sqlite3
import time
from contextlib import closing
from datetime import datetime
from pathlib import Path

import numpy as np

from bestman_bt.engine.core.status import SKIPPED
from bestman_bt.engine.logs.btlog import BtLog, LogError, Transitions
from bestman_bt.engine.logs.segmented_file import open_regular

MAGIC = b"SQLite format 3\x00"
MOST_CHANGES = 15_000_000
MOST_TIME = 120.0
"""Seconds that reading may take: the tables of a damaged or hostile file may be views without an end."""
_COUNTS_FROM_START = 60 * 10**6
"""Microseconds: a first change that is earlier is one of a run whose times count from its start."""
_LONGEST_XML = 64 << 20
_EPOCH_FROM = 10**15
"""Microseconds: from here on, which is September 2001, a time counts from the epoch, before from a machine's start."""


def is_sqlite(path: Path) -> bool:
    """Whether a file is a database; OSError where it cannot be read."""
    with open_regular(path) as file:
        return file.read(len(MAGIC)) == MAGIC


def read_sqlite(path: Path) -> BtLog:
    """The newest session of a database.

    Raises:
        LogError: it is no such database, or has too much.
        OSError: it cannot be read.
    """
    with open_regular(path):
        pass
    deadline = time.monotonic() + MOST_TIME
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            database.set_progress_handler(lambda: time.monotonic() > deadline, 100_000)
            database.execute("PRAGMA trusted_schema = OFF")
            session, date, xml = _newest(database, path)
            columns = {row[1] for row in database.execute("PRAGMA table_info(Transitions)")}
            uid = "node_uid" if "node_uid" in columns else "uid"
            rows = database.execute(
                f"SELECT timestamp, {uid}, state FROM Transitions WHERE session_id = ? "  # noqa: S608 - of two words
                "ORDER BY timestamp, rowid LIMIT ?",
                (session, MOST_CHANGES + 1),
            )
            read = np.fromiter(rows, np.dtype([("time", "i8"), ("uid", "u4"), ("status", "u1")]))
    except (sqlite3.Error, ValueError, TypeError, OverflowError) as error:
        raise LogError(f"{path} is no log of BehaviorTree.CPP, or damaged: {error}") from error
    if len(read) > MOST_CHANGES:
        raise LogError(f"{path} has more than {MOST_CHANGES} transitions")
    if len(read) and int(read["status"].max()) > SKIPPED:
        raise LogError(f"{path} is damaged: it has the state {int(read['status'].max())}")
    first = int(read["time"][0]) if len(read) else 0
    # The logger counts from the epoch or from the machine's start; exports count from the start of the run.
    origin = 0 if first < _COUNTS_FROM_START else first
    start = first * 1e-6 if first >= _EPOCH_FROM else _seconds(date)
    return BtLog(xml, start, Transitions((read["time"] - origin) * 1e-6, read["uid"].copy(), read["status"].copy()))


def _newest(database: sqlite3.Connection, path: Path) -> tuple[int, str, str]:
    row = database.execute(
        "SELECT session_id, date, xml_tree FROM Definitions "
        "WHERE length(xml_tree) <= ? ORDER BY session_id DESC LIMIT 1",
        (_LONGEST_XML,),
    ).fetchone()
    if row is None or not isinstance(row[2], str):
        raise LogError(f"{path} holds no tree")
    return int(row[0]), str(row[1]), row[2]


def _seconds(date: str) -> float:
    try:
        return max(0.0, datetime.fromisoformat(date).timestamp())
    except (ValueError, OverflowError, OSError):
        return 0.0
