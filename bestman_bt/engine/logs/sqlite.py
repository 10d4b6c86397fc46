"""State changes in a SQLite file, with the tables of BehaviorTree.CPP's SqliteLogger.

``Definitions(session_id, date, xml_tree)``, ``Nodes(session_id, fullpath, node_uid)`` and
``Transitions(timestamp, session_id, node_uid, duration, state, extra_data)``; times in microseconds, ``duration``
is how long the node had been in its previous state.
"""

from __future__ import annotations

import sqlite3
import time
from pathlib import Path

from bestman_bt.engine.logs.stamped import TransitionLog
from bestman_bt.engine.tree import StateChanges, Tree
from bestman_bt.engine.xml.writer import full_tree_xml

_TABLES = """
CREATE TABLE IF NOT EXISTS Definitions (
    session_id INTEGER PRIMARY KEY AUTOINCREMENT, date TEXT NOT NULL, xml_tree TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS Nodes (
    session_id INTEGER NOT NULL, fullpath VARCHAR, node_uid INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS Transitions (
    timestamp INTEGER NOT NULL, session_id INTEGER NOT NULL, node_uid INTEGER NOT NULL, duration INTEGER,
    state INTEGER NOT NULL, extra_data VARCHAR);
"""


class SqliteWriter(TransitionLog):
    """Adds one session to a database file; each tick is one transaction.

    Args of the constructor: the tree, the file, whether to ``append`` to sessions that are in it, and the ``date``
    that the session is labelled with (now by default).
    """

    def __init__(self, tree: Tree, path: str | Path, *, append: bool = True, date: str | None = None) -> None:
        super().__init__(tree)
        self.path = Path(path)
        self.session = 0
        self._append = append
        self._date = date
        self._database: sqlite3.Connection | None = None
        self._since: dict[int, float] = {}

    def _begin(self) -> None:
        if not self._append:
            self.path.unlink(missing_ok=True)
        database = sqlite3.connect(self.path)
        database.executescript(_TABLES)
        date = self._date or time.strftime("%Y-%m-%d %H:%M:%S")
        row = database.execute(
            "INSERT INTO Definitions (date, xml_tree) VALUES (?, ?)", (date, full_tree_xml(self._tree))
        )
        self.session = row.lastrowid or 0
        database.executemany(
            "INSERT INTO Nodes VALUES (?, ?, ?)", [(self.session, node.path, node.uid) for node in self._tree.nodes]
        )
        database.commit()
        self._database = database
        self._since = dict.fromkeys(range(1, len(self._tree.nodes) + 1), self._tree.clock.now())

    def _end(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None

    def _listen(self, changes: StateChanges) -> None:
        database = self._database
        if database is None:
            return
        stamp = changes.stamp
        rows = []
        for uid, _, state in self._with_previous(changes):
            duration = round((stamp - self._since.get(uid, stamp)) * 1e6)
            self._since[uid] = stamp
            rows.append((round(stamp * 1e6), self.session, uid, duration, state))
        database.executemany(
            "INSERT INTO Transitions (timestamp, session_id, node_uid, duration, state) VALUES (?, ?, ?, ?, ?)", rows
        )
        database.commit()
