"""Logs of BehaviorTree.CPP's SqliteLogger, ``.db3`` or ``.btdb``, which ``bestman-bt export`` also writes."""

from __future__ import annotations

import sqlite3
import time
from contextlib import closing
from datetime import datetime
from pathlib import Path

import numpy as np

from bestman_bt.engine.logs.btlog import BtLog, LogError, Transitions
from bestman_bt.engine.logs.segmented_file import open_regular
from bestman_bt.engine.status import SKIPPED

MAGIC = b"SQLite format 3\x00"
MOST_CHANGES = 15_000_000
MOST_TIME = 120.0
"""Time limit for reading, seconds: the tables of a damaged or hostile file may be infinite views."""
_COUNTS_FROM_START = 60 * 10**6
"""Largest time of a first change, microseconds, with which times count from the start of the run."""
_LONGEST_XML = 64 << 20
_EPOCH_FROM = 10**15
"""Microseconds (September 2001): later times count from the epoch, earlier ones from the boot of the machine."""


def is_sqlite(path: Path) -> bool:
    """Return whether a file is a database. Raises OSError if it cannot be read."""
    with open_regular(path) as file:
        return file.read(len(MAGIC)) == MAGIC


def read_sqlite(path: Path) -> BtLog:
    """Return the newest session of a database.

    Raises:
        LogError: it is not such a database, or is too large.
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
        raise LogError(f"{path} is not a log of BehaviorTree.CPP, or is damaged: {error}") from error
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
