from __future__ import annotations

import json
import re
from datetime import datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.engine import load_tree
from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import FAILURE, SUCCESS
from bestman_bt.evaluation.report.page import MAX_BARS, MAX_ROWS, WIDTH, gantt, groups_by_name, report_page
from bestman_bt.evaluation.report.run_reader import read_run_report
from bestman_bt.evaluation.result import Outcome
from bestman_bt.messages.black_box import BlackBox, PartTrace
from bestman_bt.records.described_tree import describe_tree
from bestman_bt.records.events import Category, DescribedNode, TreeEvent
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.states import NO
from bestman_bt.records.timeline import Activities, activities
from tests.evaluation.report.run_folders import HOSTILE, TREE, failure_with_picture, picture, write_run

NOW = datetime(2026, 3, 4, 5, 6)


class _Page(HTMLParser):
    """What a browser would make of it: elements and text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open.append(tag)
        self.text += " " if tag == "td" else ""

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if "style" not in self._open:
            self.text += data


def _page(*folders: Path) -> _Page:
    return _Page(report_page([read_run_report(folder) for folder in folders], NOW))


def test_nodes_are_named_by_file_and_line_in_tooltips_and_tables(tmp_path: Path) -> None:
    file = tmp_path / "mine.xml"
    file.write_text(TREE)
    folders = [write_run(tmp_path / name, events=(describe_tree(load_tree(file)),)) for name in ("one", "two")]

    html = report_page([read_run_report(folders[0])], NOW)
    assert "<title>second try (mine.xml:7), Sleep</title>" in html
    assert "<title>second try (mine.xml:7), " in html.replace("<title>second try (mine.xml:7), Sleep</title>", "")
    assert "<strong>second try (mine.xml:7)</strong>" in html
    assert "::" not in "".join(re.findall("<title>.*?</title>", html))
    many = report_page([read_run_report(folder) for folder in folders], NOW)
    assert "<strong>second try (mine.xml:7)</strong>" in many


def test_a_page_needs_no_script_and_nothing_beside_it(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", success=False, events=failure_with_picture())
    picture(folder / "pictures" / "1.jpg")
    picture(folder / "end.png")

    page = _page(folder)

    names = {tag for tag, _ in page.tags}
    assert not names & {"script", "link", "iframe", "object", "embed", "form"}
    sources = [value for _, attributes in page.tags for key, value in attributes.items() if key in ("src", "href")]
    assert len(sources) == 2
    assert all(source is not None and source.startswith("data:image/jpeg;base64,") for source in sources)
    assert not [key for _, attributes in page.tags for key in attributes if key.startswith("on")]


def test_names_and_words_of_a_run_are_shown_and_never_obeyed(tmp_path: Path) -> None:
    page = _page(write_run(tmp_path / "<img src=x onerror=alert(1)>", success=False))

    assert "script" not in {tag for tag, _ in page.tags}
    assert "img" not in {tag for tag, _ in page.tags}
    assert "the cup slipped <script>alert(1)</script>" in page.text
    assert "<img src=x onerror=alert(1)>" in page.text


def test_halves_of_characters_are_shown_as_something_that_can_be_written(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", killed=True)
    (folder / "config.yaml").write_text('name: "cup \\ud800"\n')
    with (folder / "log.jsonl").open("a") as log:
        log.write('{"time": 1.0, "level": "error", "event": "slipped \\udfff", "node": "a"}\n')

    page = report_page([read_run_report(folder)], NOW)

    assert "cup ?" in page
    assert "slipped ?" in page
    assert page.encode("utf-8")


def test_the_page_of_a_run_tells_outcome_failure_audit_metrics_and_nodes(tmp_path: Path) -> None:
    text = _page(write_run(tmp_path / "run", success=False)).text

    for told in ("fetch_cup, seed 1", "failure", "slipped", "ground truth reads", "place error mm", "second try"):
        assert told in text


def test_the_page_tells_contacts_in_words_and_a_success_that_is_not_the_robots(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    result = json.loads((folder / "result.json").read_text())
    contact = {"pair": ["fingers", "can"], "start_s": 1.5}
    result |= {"held_at_start": True, "audit": result["audit"] | {"declared_contacts": [contact]}}
    (folder / "result.json").write_text(json.dumps(result))

    text = _page(folder).text

    assert "pair fingers and can, start_s 1.5" in text
    assert "the goal held before the run began: the success is not the robot's" in text


def test_a_stop_is_drawn_with_what_was_set_and_measured_and_a_damaged_black_box_is_noted(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    times = np.linspace(90.0, 100.7, 1071)
    place = np.clip(times, None, 100.0) * 0.1
    columns = (
        "set position arm_pan",
        "measured position arm_pan",
        "set position arm_tilt",
        "measured position arm_tilt",
    )
    values = np.stack([place, place - 0.02, 0.0 * place, 0.0 * place], axis=1).astype(np.float32)
    trace = PartTrace(times, values, columns, ((98.0, f"held {HOSTILE}"), (99.0, "")))
    BlackBox(100.0, f"arm: {HOSTILE}", {"arm": trace}).save(folder / "black_box_1.npz")
    (folder / "black_box_2.npz").write_bytes(b"nothing")
    html = report_page([read_run_report(folder)], NOW)
    page = _Page(html)
    assert "5.0 s before to 0.7 s after it" in page.text
    assert "arm_pan: 9.480 to 10.000 rad, at most 0.020 apart" in page.text
    assert "Still: arm_tilt." in page.text
    assert "black_box_2.npz is not a black box" in page.text
    assert HOSTILE not in html
    assert 'class="held" x="189.5" y="0" width="63.2"' in html
    moment = float(html.split('class="moment" x1="')[1].split('"')[0])
    assert moment == pytest.approx(360 * 5.0 / 5.7, abs=0.1)


def test_an_interrupted_run_is_called_so(tmp_path: Path) -> None:
    assert "Interrupted." in _page(write_run(tmp_path / "run", killed=True)).text


def test_what_could_not_be_read_is_reported_on_the_page(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    (folder / "transitions.btlog").write_bytes(b"not a log")

    assert "transitions.btlog was not read" in _page(folder).text


def test_the_page_of_many_runs_tells_rates_with_intervals_causes_and_slow_nodes(tmp_path: Path) -> None:
    folders = [write_run(tmp_path / f"run{seed}", seed=seed, success=seed > 2) for seed in range(1, 11)]
    folders += [write_run(tmp_path / "killed", killed=True)]
    folders += [write_run(tmp_path / "cancelled", success=False, outcome=Outcome.CANCELLED)]

    text = re.sub(r"\s+", " ", _page(*folders).text)

    assert "8 of 10" in text
    assert "49 to 94 %" in text  # Wilson, 95 %
    assert "1 interrupted" in text
    assert "1 cancelled" in text
    assert "slipped 2" in text
    assert text.index("approach/drive") < text.index("second try")


def test_runs_of_other_settings_are_counted_apart(tmp_path: Path) -> None:
    first, second = write_run(tmp_path / "a"), write_run(tmp_path / "b", seed=2)
    config = second / "config.yaml"
    config.write_text(config.read_text() + "scene_settings:\n  finger_friction: 0.001\n")

    text = _page(first, second).text

    assert "scene.finger_friction=0.001" in text
    assert text.count("1 of 1") == 2


def _configured(folder: Path, seed: int, more: str = "", **algorithms: str) -> Path:
    """A run with algorithms, as ``dump_run`` writes them."""
    run = write_run(folder, seed=seed)
    slots = "".join(f"    {slot}: {{algorithm: {name}}}\n" for slot, name in algorithms.items())
    config = f"name: fetch_cup\ntask:\n  robot: diff_panda\n  scene: kitchen\n  algorithms:\n{slots}seed: {seed}\n"
    (run / "config.yaml").write_text(config + more)
    return run


def test_runs_with_other_algorithms_are_counted_apart_and_named_by_what_differs(tmp_path: Path) -> None:
    same = {"costmap": "layered"}
    folders = [_configured(tmp_path / f"a{n}", n, motion_planning="rrt_connect", **same) for n in range(3)]
    folders += [_configured(tmp_path / f"b{n}", n, motion_planning="bit_star", **same) for n in range(2)]

    names = list(groups_by_name([read_run_report(folder) for folder in folders]).items())

    assert [(name, len(runs)) for name, runs in names] == [
        ("fetch_cup · diff_panda · algorithms.motion_planning.algorithm=rrt_connect", 3),
        ("fetch_cup · diff_panda · algorithms.motion_planning.algorithm=bit_star", 2),
    ]
    text = _page(*folders).text
    assert "3 of 3" in text
    assert "2 of 2" in text
    assert "layered" not in text.split("Runs", maxsplit=1)[0]


def test_entries_of_a_suite_are_rows_of_their_own(tmp_path: Path) -> None:
    folders = [_configured(tmp_path / f"a{n}", n, "entry: as_shipped\n", costmap="layered") for n in range(3)]
    folders += [_configured(tmp_path / f"b{n}", n, "entry: again\n", costmap="layered") for n in range(2)]

    names = groups_by_name([read_run_report(folder) for folder in folders])

    assert list(names) == ["as_shipped · diff_panda", "again · diff_panda"]


def test_settings_that_are_too_long_to_tell_apart_still_count_apart(tmp_path: Path) -> None:
    folders = [
        _configured(tmp_path / end, 1, f"scene_settings:\n  note: {300 * 'x'}{end}\n", costmap="layered")
        for end in "ab"
    ]

    first, second = groups_by_name([read_run_report(folder) for folder in folders])

    assert second == f"{first} (2)"


def _nodes(count: int, category: Category = "action") -> NodeList:
    """Leaves below a control node, whose uids are 2 and so on."""
    root = DescribedNode(1, None, "all", "Sequence", "control", "all", {}, "")
    leaves = [DescribedNode(n, 1, f"n{n}", "Act", category, f"n{n}", {}, "") for n in range(2, count + 2)]
    nodes = NodeList()
    nodes.add(TreeEvent([root, *leaves], "", "Main"))
    return nodes


def _done(*activities: tuple[int, float, float, int]) -> Activities:
    """(node, begin, end, result)."""
    uids, begins, ends, results = np.array(sorted(activities, key=lambda one: one[1])).T
    return Activities(uids.astype(np.uint32), begins, ends, results.astype(np.uint8))


def test_bars_stand_where_the_work_was() -> None:
    chart = gantt(_nodes(1), _done((2, 2.0, 4.0, SUCCESS), (2, 6.0, 7.0, FAILURE)), 10.0)

    first, second = chart.rows[0].bars
    assert (first.x, first.width, first.state) == (0.2 * WIDTH, 0.2 * WIDTH, "success")
    assert (second.x, second.width, second.state) == (0.6 * WIDTH, 0.1 * WIDTH, "failure")
    assert second.words == "6.00 to 7.00 s: failure"


def test_bars_that_would_cover_one_another_become_one_that_shows_a_failure_among_them() -> None:
    done = [(2, 0.001 * i, 0.001 * i, SUCCESS) for i in range(500)]

    (bar,) = gantt(_nodes(1), _done(*done, (2, 0.2505, 0.2505, FAILURE)), 100.0).rows[0].bars

    assert bar.state == "failure"
    assert bar.words.endswith("(501 times)")


def test_a_condition_that_does_not_hold_is_shown_as_no() -> None:
    done = _done((2, 0.0, 0.0, NO), (2, 5.0, 5.0, NO), (2, 9.0, 9.0, FAILURE), (3, 5.0, 9.0, FAILURE))

    rows = gantt(_nodes(2, "condition"), done, 10.0).rows

    assert [bar.state for bar in rows[0].bars] == ["no", "no", "failure"]
    assert rows[0].bars[0].words == "0.00 s: no"
    assert rows[1].bars[0].state == "failure"


def test_an_answer_is_not_lost_among_others_that_it_would_cover() -> None:
    done = [(2, 0.001 * i, 0.001 * i, (SUCCESS, NO)[i == 7]) for i in range(9)]

    (bar,) = gantt(_nodes(1, "condition"), _done(*done), 100.0).rows[0].bars

    assert bar.state == "no"


def test_a_chart_is_bounded_and_keeps_the_nodes_that_took_the_most_time() -> None:
    nodes = _nodes(1000)
    done = [(uid, t, t + 0.001 * uid, SUCCESS) for uid in range(2, 1002) for t in range(0, 200, 2)]

    chart = gantt(nodes, _done(*done), 200.0)

    assert len(chart.rows) == MAX_ROWS
    assert chart.hidden == 1000 - MAX_ROWS
    assert sum(len(row.bars) for row in chart.rows) <= MAX_BARS
    assert chart.rows[-1].node.name == "n1001"


@pytest.mark.parametrize("duration", [0.0, 0.3, 59.0, 3600.0, 1e6])
def test_the_time_axis_has_few_ticks_whatever_the_length(duration: float) -> None:
    ticks = gantt(NodeList(), activities(Transitions.none(), 0.0), duration).ticks

    assert 1 <= len(ticks) <= 13
    assert all(0 <= x <= WIDTH for x, _ in ticks)
