"""Run folders in the monitor: finished, cut off, damaged and hostile ones."""

from __future__ import annotations

import asyncio
import json
import lzma
import os
import re
import shutil
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import ManualClock, NodeRegistry, load_tree
from bestman_bt.engine.logs.btlog import BtLogWriter
from bestman_bt.monitor.recorded import RecordedRun, read_run
from bestman_bt.monitor.run import RunError
from bestman_bt.monitor.run_list import MAX_LOADED, RunList
from bestman_bt.records.events import LogEvent, RunEvent, from_line
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import (
    LARGEST_FILE,
    LONGEST_SEGMENT,
    RecordError,
    read_events,
    read_log,
    read_picture,
    run_folders,
)
from bestman_bt.records.writer import RunLogWriter
from tests.monitor.conftest import FakeExecutor, Message, Monitor, run_event, states_event, tree_event

EVIL = "<script>alert(1)</script>"
TREE = f"""<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Sequence name="main"><AlwaysSuccess name="{EVIL.replace("<", "&lt;")}"/><Fallback name="or">
    <AlwaysFailure name="no"/><Sleep name="wait" msec="400"/></Fallback></Sequence>
</BehaviorTree></root>"""
IDLE, RUNNING, SUCCESS, FAILURE = 0, 1, 2, 3
StartMonitor = Callable[..., Monitor]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder of a run of six ticks that ended well."""
    run = tmp_path / "20260101-fetch-7"
    run.mkdir()
    clock = ManualClock()
    tree = load_tree(TREE, NodeRegistry(), clock=clock)
    with BtLogWriter(tree, run / "transitions.btlog"):
        while tree.tick_exactly_once() == RUNNING:
            clock.advance(0.1)
    events = [run_event(folder=str(run), task="fetch"), image(0.2, "pictures/0001.jpg"), end(0.5)]
    write_lines(run / "events.jsonl", events)
    write_lines(run / "log.jsonl", [{"time": 0.1, "level": "error", "event": EVIL, "node": "or", "code": "bad"}])
    (run / "pictures").mkdir()
    (run / "pictures" / "0001.jpg").write_bytes(b"\xff\xd8jpeg")
    (run / "result.json").write_text(json.dumps({"task": "fetch", "seed": 7, "outcome": "success"}))
    return run


def image(time: float, file: str) -> Message:
    return {"event": "image", "time": time, "camera": "head", "width": 1, "height": 1, "file": file}


def end(time: float) -> Message:
    return {"event": "end", "time": time, "outcome": "success", "tree_status": "SUCCESS"}


def write_lines(path: Path, documents: list[Any]) -> None:
    path.write_text("".join(json.dumps(document) + "\n" for document in documents))


def history_of(folder: Path) -> RunHistory:
    return read_run(folder)


def warnings_of(history: RunHistory) -> list[str]:
    return [line["message"] for line in history.lines_since(-1, 100) if line["level"] == "warning"]


def test_a_finished_run_is_read_whole(folder: Path) -> None:
    history = history_of(folder)
    assert [node.name for node in history.nodes] == ["main", EVIL, "or", "no", "wait"]
    assert [node.parent for node in history.nodes] == [None, 1, 1, 3, 3]
    assert list(history.states.at(0.25).nodes.states) == [0, RUNNING, SUCCESS, RUNNING, FAILURE, RUNNING]
    assert [history.states.at(time).tick for time in (0.0, 0.5)] == [1, 9], "at 20 Hz; the first tick is number 1"
    assert history.states.at(0.25).nodes.statistics([5], 0.25) == {"5": [1, 0, 0, 0.25]}
    assert [line["message"] for line in history.lines_since(-1, 10)] == [EVIL]
    assert (history.last, history.about["task"], history.end["outcome"]) == (0.5, "fetch", "success")


def test_a_run_that_has_only_its_btlog_is_shown(folder: Path) -> None:
    for name in ("events.jsonl", "log.jsonl", "result.json"):
        (folder / name).unlink()
    assert history_of(folder).states.at(0.25).nodes.states[5] == RUNNING
    run = RecordedRun("run-1", folder)
    run.look()
    assert (run.state, run.summary()["task"]) == ("interrupted", folder.name)


def test_a_run_that_was_killed_is_readable_to_its_last_whole_record(folder: Path) -> None:
    (folder / "result.json").unlink()
    btlog, events = folder / "transitions.btlog", folder / "events.jsonl"
    btlog.write_bytes(btlog.read_bytes()[:-4])
    write_lines(events, [run_event(), states_event(0.2, messages={"4": "no cup"})])
    with events.open("a") as file:
        file.write('{"event":"robot","time":0.3,"ba')
    history = history_of(folder)
    assert history.message_at(4, 0.3) == "no cup"
    assert history.states.at(0.35).nodes.states[5] == RUNNING


def test_a_page_travels_through_a_finished_run(folder: Path, start_monitor: StartMonitor) -> None:
    monitor = start_monitor(folder.parent)
    with monitor.page() as page:
        (run,) = page.next("hello")["runs"]
        assert (run["kind"], run["state"], run["outcome"], run["seed"]) == ("recorded", "ended", "success", 7)
        page.ask("open", id=run["id"], n=1)
        state = page.next("state")
        assert (state["time"], state["live"], state["last"]) == (0.0, False, 0.5)
        page.ask("seek", id=run["id"], time=0.25)
        assert page.next("state")["states"]["0"][4] == RUNNING
        picture = page.next("image")
        with monitor.http() as http:
            assert http.get(picture["url"]).content == b"\xff\xd8jpeg"
        page.ask("timeline", id=run["id"])
        timeline = page.next("timeline")
        assert {"uid": 4, "state": FAILURE, "from": 0.0, "to": 0.4} in timeline["spans"]
        page.ask("pause", id=run["id"], n=2)
        assert "over" in page.next("answer", lambda answer: answer["for"] == 2)["error"]


def test_two_runs_are_compared(folder: Path, tmp_path: Path, start_monitor: StartMonitor) -> None:
    other = tmp_path / "other"
    other.mkdir()
    tree = load_tree(TREE.replace("AlwaysFailure", "AlwaysSuccess"), NodeRegistry(), clock=ManualClock())
    with BtLogWriter(tree, other / "transitions.btlog"):
        tree.tick_exactly_once()
    with start_monitor(folder, other).page() as page:
        runs = {Path(run["folder"]).name: run["id"] for run in page.next("hello")["runs"]}
        page.ask("compare", ids=[runs[folder.name], runs["other"]], n=3)
        comparison = page.next("comparison")
    assert comparison["parted"]["path"] == "no"
    assert (comparison["parted"]["state_a"], comparison["parted"]["state_b"]) == (FAILURE, SUCCESS)


@pytest.mark.parametrize("content", [b"", b"BTCPP4", b"BTCPP4-FileLogger2\x01\xff\xff\xff\x7f<root", os.urandom(5000)])
def test_a_damaged_btlog_is_told_to_the_page(folder: Path, start_monitor: StartMonitor, content: bytes) -> None:
    (folder / "transitions.btlog").write_bytes(content)
    with start_monitor(folder).page() as page:
        (run,) = page.next("hello")["runs"]
        page.ask("open", id=run["id"], n=1)
        assert page.next("answer")["ok"]
        (line,) = page.next("log", lambda log: bool(log["lines"]))["lines"][-1:]
    assert (line["level"], line["logger"]) == ("warning", "monitor")
    assert "transitions.btlog was not read to its end" in line["message"]


@pytest.mark.parametrize(
    "line",
    [
        "no json",
        "[" * 100_000,
        '{"event": "states"}',
        '{"event": "explode", "time": 1}',
        json.dumps(states_event(0.1, tree=8)),
        json.dumps({**tree_event(), "nodes": []}),
    ],
)
def test_a_damaged_event_is_reported_in_the_log_and_the_rest_is_shown(folder: Path, line: str) -> None:
    (folder / "events.jsonl").write_text(json.dumps(run_event()) + "\n" + line + "\n")
    history = history_of(folder)
    assert history.about["task"] == "fetch"
    assert re.search("was not read to its end: .* line 2|does not fit the run", warnings_of(history)[-1])
    assert next(line["message"] for line in history.lines_since(-1, 10)) == EVIL


def test_a_folder_in_which_nothing_can_be_read_is_refused(folder: Path) -> None:
    for name in ("events.jsonl", "log.jsonl"):
        (folder / name).unlink()
    (folder / "transitions.btlog").write_bytes(b"\x7fELF")
    with pytest.raises(RunError, match="cannot be read"):
        history_of(folder)


def test_a_run_that_was_moved_is_shown_with_the_folder_where_it_is_now(folder: Path, tmp_path: Path) -> None:
    moved = folder.rename(tmp_path / "elsewhere")
    assert history_of(moved).about["folder"] == str(moved)


def test_a_tree_with_external_entities_is_refused(folder: Path) -> None:
    path = folder / "transitions.btlog"
    xml = b'<!DOCTYPE root [<!ENTITY x SYSTEM "file:///etc/passwd">]><root BTCPP_format="4">&x;</root>'
    path.write_bytes(b"BTCPP4-FileLogger2\x01" + len(xml).to_bytes(4, "little") + xml + bytes(8))
    assert "transitions.btlog was not read to its end" in warnings_of(history_of(folder))[-1]


def test_files_that_are_too_large_are_refused_before_they_are_read(folder: Path) -> None:
    with (folder / "transitions.btlog").open("r+b") as file:
        file.truncate(LARGEST_FILE + 1)  # a hole: it takes no room
    assert re.match(
        r"transitions\.btlog was not read to its end: it has \d+ bytes; at most ", warnings_of(history_of(folder))[-1]
    )


def test_compressed_segments_cannot_fill_the_memory(folder: Path) -> None:
    bomb = lzma.compress(b"x\n" + bytes(64 << 20), preset=0)
    for number in range(1, 40):
        (folder / f"events.{number:04}.jsonl.xz").write_bytes(bomb)
    tracemalloc.start()
    try:
        assert "line 1: no event" in warnings_of(history_of(folder))[-1]
        assert tracemalloc.get_traced_memory()[1] < 6 * LONGEST_SEGMENT
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "name", ["../secret.jpg", "/etc/passwd", "pictures/../../secret.jpg", "pictures/link.jpg", "pictures/x.txt", "\0"]
)
def test_pictures_come_only_from_the_runs_own_folder(folder: Path, name: str) -> None:
    (folder.parent / "secret.jpg").write_bytes(b"secret")
    (folder / "pictures" / "link.jpg").symlink_to(folder.parent / "secret.jpg")
    (folder / "pictures" / "x.txt").write_bytes(b"secret")
    with pytest.raises(RecordError):
        read_picture(folder, name)
    assert read_picture(folder, "pictures/0001.jpg") == b"\xff\xd8jpeg"


def test_a_pictures_folder_that_is_a_link_does_not_leave_the_run(folder: Path) -> None:
    elsewhere = folder.parent / "elsewhere"
    (folder / "pictures").rename(elsewhere)
    (folder / "pictures").symlink_to(elsewhere)
    with pytest.raises(RecordError, match="is not one of its pictures"):
        read_picture(folder, "pictures/0001.jpg")


def test_a_run_folder_that_is_itself_reached_by_a_link_shows_its_pictures(folder: Path) -> None:
    link = folder.parent / "link"
    link.symlink_to(folder)
    assert read_picture(link, "pictures/0001.jpg") == b"\xff\xd8jpeg"


@pytest.mark.parametrize("name", ["events.0001.jsonl.xz", "log.0001.jsonl", "transitions.0001.btlog.xz"])
def test_a_pipe_among_the_segments_holds_nobody_up(folder: Path, name: str) -> None:
    os.mkfifo(folder / name)
    RecordedRun("run-1", folder).look()
    assert "not a regular file" in warnings_of(history_of(folder))[-1]


def test_events_that_are_missing_in_the_middle_are_reported(folder: Path) -> None:
    write_lines(folder / "events.0001.jsonl", [run_event(), states_event(0.1)])
    write_lines(folder / "events.0003.jsonl", [states_event(0.3)])
    told = list(read_events(folder))
    assert [(event.event, getattr(event, "time", None)) for event in told[:4]] == [
        ("run", None),
        ("states", 0.1),
        ("log", 0.1),
        ("states", 0.3),
    ]
    assert warnings_of(history_of(folder)) == ["a part of events.jsonl that follows here was not read"]


def test_states_that_are_missing_in_the_middle_are_reported(folder: Path) -> None:
    btlog = folder / "transitions.btlog"
    (folder / "transitions.0001.btlog").write_bytes(btlog.read_bytes()[:-18])
    btlog.rename(folder / "transitions.0003.btlog")
    history = history_of(folder)
    assert re.fullmatch(r"the states from 0\.\d s to 0\.0 s were not read", warnings_of(history)[0])
    assert [mark["kind"] for mark in history.timeline.document(1.0)["marks"]].count("warning") == 1


def test_a_pipe_for_a_picture_is_refused_at_once(folder: Path) -> None:
    os.mkfifo(folder / "pictures" / "pipe.jpg")
    with pytest.raises(RecordError, match="not a regular file"):
        read_picture(folder, "pictures/pipe.jpg")


def test_a_damaged_result_is_reported_in_the_log(folder: Path, start_monitor: StartMonitor) -> None:
    (folder / "result.json").write_text("{")
    with start_monitor(folder).page() as page:
        (run,) = page.next("hello")["runs"]
        page.ask("open", id=run["id"])
        log = page.next("log")
    assert "result.json cannot be read" in log["lines"][-1]["message"]


def test_a_result_that_was_mended_is_damaged_no_more(folder: Path) -> None:
    run, text = RecordedRun("run-1", folder), (folder / "result.json").read_text()
    for content, told in (("{", True), (text, False)):
        (folder / "result.json").write_text(content)
        run.look()
        asyncio.run(run.open())
        lines = run.history.lines_since(-1, 500)
        assert any("result.json cannot be read" in line["message"] for line in lines) is told


def test_new_run_folders_are_found(folder: Path, tmp_path: Path) -> None:
    assert run_folders(folder) == [folder]
    assert run_folders(tmp_path) == [folder]
    assert run_folders(folder / "pictures") == []
    assert run_folders(tmp_path / "nowhere") == []


def test_known_run_folders_cost_nothing_until_something_changes(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[Path] = []
    is_file, summary = Path.is_file, RecordedRun.summary
    monkeypatch.setattr(Path, "is_file", lambda path: looked.append(path) or is_file(path))
    monkeypatch.setattr(RecordedRun, "summary", lambda run: looked.append(run.folder) or summary(run))

    async def watch() -> None:
        runs = RunList([tmp_path])
        await runs._look_for_folders()
        runs._notify_changes()
        (run,) = runs._recorded.values()
        looked.clear()
        await runs._look_for_folders()
        runs._notify_changes()
        assert not [path for path in looked if path.is_relative_to(folder)]
        assert runs.version == 1
        await run.open()
        runs._notify_changes()
        assert runs.version == 2
        shutil.copytree(folder, tmp_path / "another")
        await runs._look_for_folders()
        runs._notify_changes()
        assert (runs.version, len(runs.summaries())) == (3, 2)

    asyncio.run(watch())


def test_of_recorded_runs_that_nobody_looks_at_those_that_were_opened_last_are_held(folder: Path) -> None:
    runs = RunList()
    for number in range(MAX_LOADED + 2):
        run = RecordedRun(f"run-{number}", folder)
        run.is_loaded, run.opened = True, float(-number)
        runs._recorded[run.id] = run
    runs._recorded[f"run-{MAX_LOADED}"].watchers.add(asyncio.Event())
    asyncio.run(runs._forget())
    assert [run.id for run in runs._recorded.values() if not run.is_loaded] == [f"run-{MAX_LOADED + 1}"]


def test_a_log_line_of_the_very_start_is_read_again(tmp_path: Path) -> None:
    start = from_line(json.dumps(run_event()).encode())
    assert isinstance(start, RunEvent)
    log = RunLogWriter(tmp_path, load_tree(TREE, NodeRegistry()), start)
    line = LogEvent(0.0, "warning", "no camera", "main/look", "no_image")
    log.write(line)
    log.close()
    assert list(read_log(tmp_path)) == [line]


def test_the_past_of_a_run_is_known_to_a_monitor_that_comes_later(folder: Path, start_monitor: StartMonitor) -> None:
    """A monitor that is started anew shows the whole run, not only what comes from now on."""
    (folder / "result.json").unlink()
    write_lines(folder / "events.jsonl", [run_event()])
    nodes = [(n, p, "x", "T", "action") for n, p in ((1, None), (2, 1), (3, 1), (4, 3), (5, 3))]
    executor = FakeExecutor(nodes=nodes, folder=str(folder))
    executor.first[-1] = states_event(0.9, (1, RUNNING), (2, SUCCESS), (3, RUNNING), (4, FAILURE), (5, RUNNING))
    try:
        with start_monitor().page() as page:
            page.next("runs", lambda message: bool(message["runs"]))
            page.ask("open", id=executor.path.stem)
            assert page.next("state")["time"] == 0.9
            page.ask("seek", id=executor.path.stem, time=0.15)
            assert page.next("state")["statistics"]["5"] == [1, 0, 0, pytest.approx(0.15)]
    finally:
        executor.close()
