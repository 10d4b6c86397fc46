from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest

from bestman_bt.engine import load_tree
from bestman_bt.engine.logs.btlog import BtLogWriter
from bestman_bt.engine.status import FAILURE, RUNNING, SUCCESS
from bestman_bt.evaluation.report.run_reader import (
    MAX_BYTES,
    ReportError,
    RunReport,
    folders_to_report,
    read_run_report,
)
from bestman_bt.evaluation.result import Outcome
from bestman_bt.records.events import DescribedNode, ImageEvent, LogEvent, StatesEvent, TreeEvent
from bestman_bt.records.states import NO
from tests.evaluation.report.run_folders import HOSTILE, SteppedClock, failure_with_picture, picture, write_run


def worked(story: RunReport, uid: int) -> list[tuple[float, float, int]]:
    """When a node was at work, and what came of it."""
    mine = dict(story.activities.by_node())[uid]
    return list(zip(mine.begins.tolist(), mine.ends.tolist(), mine.results.tolist(), strict=True))


def test_a_finished_run_is_reported_with_its_times_and_nodes(tmp_path: Path) -> None:
    story = read_run_report(write_run(tmp_path / "run", seed=4))

    assert (story.task, story.seed, story.robot, story.scene) == ("fetch_cup", 4, "diff_panda", "kitchen")
    assert story.outcome == "success"
    assert story.started == pytest.approx(1.7e9)
    assert story.notes == ()
    by_name = {node.name: node for node in story.nodes}
    assert worked(story, by_name["drive"].uid) == [(0.0, pytest.approx(1.0), SUCCESS)]
    assert by_name["drive"].parent == by_name["approach"].uid
    assert story.duration == pytest.approx(1.6, abs=0.11)


def test_a_tree_that_failed_is_reported_with_the_condition_that_ended_it(tmp_path: Path) -> None:
    asking = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
        <Fallback><ScriptCondition name="held" code="1 == 2"/><Sleep name="grasp" msec="100"/></Fallback>
        <ScriptCondition name="ready" code="1 == 2"/></Sequence></BehaviorTree></root>"""
    clock = SteppedClock()
    tree = load_tree(asking, clock=clock)
    with BtLogWriter(tree, tmp_path / "transitions.btlog"):
        while tree.tick_exactly_once() == RUNNING:
            clock.sleep(0.05)

    story = read_run_report(tmp_path)

    ready = next(node for node in story.nodes if node.name == "ready")
    assert worked(story, ready.uid) == [(pytest.approx(0.1), pytest.approx(0.1), FAILURE)]
    held = next(node for node in story.nodes if node.name == "held")
    assert {result for _, _, result in worked(story, held.uid)} == {NO}


def test_a_run_without_an_end_was_interrupted(tmp_path: Path) -> None:
    story = read_run_report(write_run(tmp_path / "run", killed=True))

    assert story.outcome == "interrupted"
    assert not story.is_counted
    assert story.result is None
    assert story.duration == pytest.approx(0.0, abs=0.3)


def test_a_run_whose_log_is_cut_off_anywhere_is_read_to_there(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", killed=True)
    log = folder / "transitions.btlog"
    log.write_bytes(log.read_bytes()[:-4])
    events = folder / "events.jsonl"
    events.write_bytes(events.read_bytes() + b'{"event":"log","ti')

    story = read_run_report(folder)

    assert story.notes == ()
    assert len(story.activities)


def test_a_run_whose_executor_answers_is_still_running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_run(tmp_path / "run", killed=True)
    monkeypatch.chdir(folder)  # socket paths are short
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server:
        server.bind("served.sock")
        server.listen()
        Path("control.sock").symlink_to("served.sock")

        assert read_run_report(Path()).outcome == "running"

    assert read_run_report(Path()).outcome == "interrupted"


def test_a_failure_comes_with_the_picture_of_that_moment(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", success=False, events=failure_with_picture())
    picture(folder / "pictures" / "1.jpg")

    (failure,) = read_run_report(folder).failures

    assert (failure.time, failure.node, failure.code) == (1.4, f"Grasp {HOSTILE} (my.xml:9)", "no_grasp")
    assert failure.picture is not None
    assert failure.picture.jpeg.startswith(b"\xff\xd8")


@pytest.mark.parametrize(("pixels", "fits"), [(768, True), (767, False)])
def test_a_picture_is_unfolded_up_to_a_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pixels: int, fits: bool
) -> None:
    monkeypatch.setattr("bestman_bt.evaluation.report.run_reader.MAX_PIXELS", pixels)
    folder = write_run(tmp_path / "run", success=False, events=failure_with_picture())
    picture(folder / "pictures" / "1.jpg", 32, 24)

    story = read_run_report(folder)

    assert (story.failures[0].picture is not None) is fits
    assert story.notes == (
        () if fits else (f"picture left out: 'pictures/1.jpg': it has 32 × 24 pixels; at most {pixels} are read",)
    )


def test_of_several_pictures_of_a_node_a_failure_comes_with_the_nearest_one(tmp_path: Path) -> None:
    told = ((1.4, "pictures/1.jpg"), (1.6, "pictures/2.jpg"), (1.6, "pictures/3.jpg"))
    lines = tuple(LogEvent(time, "warning", "out of reach", "work/Grasp::7", "no_grasp") for time in (1.4, 1.6, 2.2))
    images = tuple(ImageEvent(time, file[9], 32, 24, file=file, node="work/Grasp::7") for time, file in told)
    folder = write_run(tmp_path / "run", success=False, events=(*lines, *images))
    for _, file in told:
        picture(folder / file)

    shown = [failure.picture for failure in read_run_report(folder).failures]

    assert [one.caption if one else "" for one in shown] == ["1 at 1.40 s", "3 at 1.60 s", ""]


def test_trees_that_a_leaf_has_ticked_stand_below_that_leaf(tmp_path: Path) -> None:
    node = DescribedNode(1, None, "planned", "Sequence", "control", "planned", {}, "")
    leaf = DescribedNode(2, 1, "pick up", "Pick", "action", "pick up", {}, "")
    events = (
        TreeEvent([node, leaf], "", "Plan", tree=1, under=7),
        StatesEvent(0.5, 10, [(1, 1), (2, 1)], tree=1),
        StatesEvent(0.9, 18, [(2, 3)], tree=1),
    )

    story = read_run_report(write_run(tmp_path / "run", events=events))

    nodes = list(story.nodes.depth_first())
    under = next(index for index, node in enumerate(nodes) if node.uid == 7)
    assert [node.name for node in nodes[under + 1 : under + 3]] == ["planned", "pick up"]
    assert worked(story, nodes[under + 2].uid) == [(0.5, 0.9, FAILURE)]


@pytest.mark.parametrize("name", ["../secret.png", "/etc/passwd", "pictures/../../secret.png", "link.png"])
def test_a_picture_that_leads_out_of_the_folder_is_left_out(tmp_path: Path, name: str) -> None:
    picture(tmp_path / "secret.png")
    folder = write_run(tmp_path / "run", events=failure_with_picture(name))
    (folder / "pictures").mkdir()
    (folder / "link.png").symlink_to(tmp_path / "secret.png")

    story = read_run_report(folder)

    assert story.failures[0].picture is None
    assert any("picture left out" in note for note in story.notes)


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        ("result.json", b"{", "result.json was not read to its end"),
        ("result.json", b"[" * 200_000, "result.json was not read to its end"),
        ("result.json", b"[1]", "it is not a JSON object"),
        ("result.json", json.dumps({"task": 3}).encode(), "result.json was not read to its end: task"),
        ("config.yaml", b"\xff\xfe\x00", "config.yaml was not read"),
        ("config.yaml", b"a: [", "config.yaml was not read"),
        ("config.yaml", b"[" * 1_000, "config.yaml was not read"),
        ("transitions.btlog", b"MZ" + bytes(100), "is not a .btlog file"),
        ("transitions.btlog", b"BTCPP4-FileLogger2\x01\xff\xff\xff\x7f", "cut off within its XML"),
        ("events.jsonl", b"\x00\xff\n" * 3, "events.jsonl was not read to its end"),
        ("log.jsonl", b'{"event":"x","time":1e999,"level":"info"}\n', "inf is not a time"),
    ],
)
def test_a_damaged_part_is_noted_and_the_others_are_reported(
    tmp_path: Path, file: str, content: bytes, words: str
) -> None:
    folder = write_run(tmp_path / "run")
    (folder / file).write_bytes(content)

    story = read_run_report(folder)

    assert any(words in note for note in story.notes), story.notes


@pytest.mark.parametrize("file", list(MAX_BYTES))
def test_a_part_that_is_too_large_is_not_read(tmp_path: Path, file: str) -> None:
    folder = write_run(tmp_path / "run")
    with (folder / file).open("wb") as part:
        part.truncate(MAX_BYTES[file] + 1)

    assert any(note.startswith(f"{file} was not read") and "at most" in note for note in read_run_report(folder).notes)


def test_a_configuration_with_an_alias_bomb_is_refused_at_once(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    bomb += "".join(f"a{n}: &a{n} [{', '.join(9 * [f'*a{n - 1}'])}]\n" for n in range(1, 10))
    (folder / "config.yaml").write_text(f"{bomb}name: *a9\n")

    story = read_run_report(folder)

    assert any("it has aliases" in note for note in story.notes)
    assert story.config.startswith("a0:")


def test_numbers_of_a_configuration_stay_text_however_long_they_are(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", killed=True)
    digits = "0x" + 100_000 * "f"
    (folder / "config.yaml").write_text(f"name: [1]\nseed: {digits}\nscene_settings:\n  size: {digits}\n  on: true\n")

    story = read_run_report(folder)

    assert (story.notes, story.task, story.seed) == ((), folder.name, 0)
    assert story.scene_and_robot_settings == f"{('scene.size=' + digits)[:200]}, scene.on=true"


def test_a_log_with_an_entity_bomb_is_refused(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    xml = b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">]><root>&a;</root>'
    head = b"BTCPP4-FileLogger2\x01" + len(xml).to_bytes(4, "little") + xml + bytes(8)
    (folder / "transitions.btlog").write_bytes(head)

    assert any("entity declarations are refused" in note for note in read_run_report(folder).notes)


def test_a_folder_of_nothing_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="is not a folder"):
        folders_to_report(tmp_path / "not_there")
    with pytest.raises(ReportError, match="is not a run folder and contains none"):
        folders_to_report(tmp_path)
    (tmp_path / "result.json").write_text("not json")
    with pytest.raises(ReportError, match="result.json was not read to its end"):
        read_run_report(tmp_path)


def test_the_runs_below_a_folder_are_found_and_links_are_not_followed(tmp_path: Path) -> None:
    first = write_run(tmp_path / "evaluation" / "runs" / "a")
    second = write_run(tmp_path / "evaluation" / "runs" / "b", outcome=Outcome.CANCELLED)
    (tmp_path / "evaluation" / "again").symlink_to(tmp_path)

    assert folders_to_report(tmp_path) == [first, second]
    assert folders_to_report(first) == [first]


def test_hostile_names_are_kept_as_text(tmp_path: Path) -> None:
    assert HOSTILE in {node.name for node in read_run_report(write_run(tmp_path / "run")).nodes}


def test_a_log_alone_and_a_process_of_others_are_titled_by_what_they_are(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", killed=True)
    for part in ("config.yaml", "result.json"):
        (folder / part).unlink(missing_ok=True)
    assert read_run_report(folder / "transitions.btlog").title == "transitions.btlog"
    events = folder / "events.jsonl"
    events.write_text(events.read_text().replace('"source":""', '"source":"groot2://127.0.0.1:1667"', 1))
    assert read_run_report(folder).title.endswith(", groot2://127.0.0.1:1667")
