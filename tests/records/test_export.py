"""Exports of a run that was recorded by the real writer."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import pytest

from bestman_bt.engine import IDLE, RUNNING, SUCCESS, ManualClock, load_tree
from bestman_bt.engine.logs.btlog import BtLogWriter
from bestman_bt.records.export import export_chrome, export_jsonl, export_sqlite
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import RecordError, read

XML = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence name="seq"><AlwaysSuccess name="init"/><SubTree ID="Sub" name="sub"/></Sequence>
</BehaviorTree><BehaviorTree ID="Sub"><Sleep name="nap" msec="100"/></BehaviorTree></root>"""


def recorded(path: Path, ticks: int) -> RunHistory:
    clock = ManualClock(5.0)
    tree = load_tree(XML, clock=clock)
    with BtLogWriter(tree, path / "run.btlog", start=1000.0):
        for _ in range(ticks):
            tree.tick_exactly_once()
            clock.advance(0.1)
    return read(path / "run.btlog")


def test_json_lines_hold_paths_and_both_states(tmp_path: Path) -> None:
    export_jsonl(recorded(tmp_path, 2), tmp_path / "run.jsonl")

    lines = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert {"time": 0.0, "uid": 4, "path": "sub/nap", "from": "IDLE", "to": "RUNNING"} in lines
    assert [line["from"] for line in lines if line["uid"] == 4] == ["IDLE", "RUNNING", "SUCCESS"]


def test_sqlite_keeps_sessions_with_their_durations(tmp_path: Path) -> None:
    history = recorded(tmp_path, 2)
    for _ in range(2):
        export_sqlite(history, tmp_path / "run.db")

    with sqlite3.connect(tmp_path / "run.db") as database:
        assert database.execute("SELECT count(*) FROM Definitions").fetchone() == (2,)
        (xml,) = database.execute("SELECT xml_tree FROM Definitions").fetchone()
        assert xml.startswith("<root BTCPP_format")
        found = database.execute("SELECT fullpath FROM Nodes WHERE session_id = 1 AND node_uid = 4").fetchone()
        assert found == ("sub/nap",)
        rows = database.execute(
            "SELECT state, duration FROM Transitions WHERE session_id = 2 AND node_uid = 4 ORDER BY rowid"
        ).fetchall()
    assert rows == [(RUNNING, 0), (SUCCESS, 100_000), (IDLE, 0)]


@pytest.mark.parametrize("ticks", [1, 2])
def test_a_chrome_trace_has_a_slice_for_each_time_a_node_ran_and_ends_those_that_last(
    tmp_path: Path, ticks: int
) -> None:
    export_chrome(recorded(tmp_path, ticks), tmp_path / "run.json")

    events = json.loads((tmp_path / "run.json").read_text())
    assert sum(e["ph"] == "B" for e in events) == sum(e["ph"] == "E" for e in events) == 3
    nap = [(e["ph"], e["ts"]) for e in events if e.get("tid") == 4 and e["ph"] in "BE"]
    assert nap == [("B", 0.0), ("E", pytest.approx(1e5 if ticks == 2 else 0.0))]


def test_what_was_exported_as_sqlite_reads_as_the_run(tmp_path: Path) -> None:
    history = recorded(tmp_path, 2)
    export_sqlite(history, tmp_path / "run.db3")
    again = read(tmp_path / "run.db3")
    for told in (again, history):
        assert [(round(c.time, 6), c.uid, c.status) for c in told.states.changes()][3:5] == [
            (0.0, 4, RUNNING),
            (0.1, 4, SUCCESS),
        ]
    assert len(again.states.changes()) == len(history.states.changes())
    assert [node.path for node in again.nodes] == [node.path for node in history.nodes]
    assert again.about["started"] == pytest.approx(1000.0)
    assert again.end is not None
    assert again.end["outcome"] == "success"


def logged_by_cpp(path: Path, rows: list[tuple[int, int, int]], view: str = "") -> Path:
    """A database as SqliteLogger of BehaviorTree.CPP 4.3 writes it: other names of columns, time since the epoch."""
    xml = recorded(path.parent, 1).xml
    with sqlite3.connect(path) as database:
        transitions = "timestamp INTEGER PRIMARY KEY NOT NULL, session_id, uid, duration, state, metadata"
        database.execute(view or f"CREATE TABLE Transitions ({transitions})")
        database.execute("CREATE TABLE Definitions (session_id INTEGER PRIMARY KEY AUTOINCREMENT, date TEXT, xml_tree)")
        database.execute("INSERT INTO Definitions (date, xml_tree) VALUES ('2026-01-01 12:00:00', ?)", [xml])
        if not view:
            database.executemany("INSERT INTO Transitions VALUES (?, 1, ?, 0, ?, NULL)", rows)
    return path


def test_logs_of_behaviortree_cpp_begin_with_their_first_change(tmp_path: Path) -> None:
    began = 1_750_000_000_000_000
    path = logged_by_cpp(tmp_path / "log.db3", [(began, 1, RUNNING), (began + 1, 4, RUNNING), (began + 500_000, 4, 2)])
    history = read(path)
    assert [(round(c.time, 6), c.uid, c.status) for c in history.states.changes()] == [
        (0.0, 1, RUNNING),
        (1e-6, 4, RUNNING),
        (0.5, 4, SUCCESS),
    ]
    assert history.about["started"] == began * 1e-6
    assert history.end is None


@pytest.mark.parametrize(
    ("rows", "view", "complaint"),
    [
        ([(5, 1, 77)], "", "it has the state 77"),
        ([(5, 1, "x")], "", "damaged"),
        ([], "CREATE VIEW Transitions AS SELECT 1", "damaged: no such column"),
    ],
)
def test_damaged_databases_are_reported(
    tmp_path: Path, rows: list[tuple[int, int, int]], view: str, complaint: str
) -> None:
    with pytest.raises(RecordError, match=complaint):
        read(logged_by_cpp(tmp_path / "log.db3", rows, view))
