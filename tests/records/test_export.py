"""Exports of a run that was recorded by the real writer."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import pytest

from bestman_bt.engine import IDLE, RUNNING, SUCCESS, ManualClock, load_tree
from bestman_bt.engine.logs import BtLogWriter
from bestman_bt.records.export import export_chrome, export_jsonl, export_sqlite
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import read

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
