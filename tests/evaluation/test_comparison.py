"""Comparisons of entries and of evaluations in folders, and their pictures."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.code_version import config_fingerprint
from bestman_bt.evaluation.comparison import differences_table, matched, short_names, within
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.finished_evaluation import FinishedEntry, read_entries
from bestman_bt.evaluation.journal import EpisodeKey, Journal
from bestman_bt.evaluation.suite import Suite, SuiteEntry
from tests.evaluation.evaluated import finished_evaluation
from tests.evaluation.test_paired_comparison import run
from tests.evaluation.test_summary import result

RRT, BIT = "algorithms.motion_planning.algorithm=rrt_connect", "algorithms.motion_planning.algorithm=bit_star"


def entry(name: str, task: str = "fetch_cup", shift: float = 0.0) -> FinishedEntry:
    return FinishedEntry(name, task, tuple(run(seed, error=seed + shift) for seed in range(8)))


def test_entries_are_compared_with_the_first_of_their_task() -> None:
    entries = [entry("a"), entry("drawer_a", "open_drawer"), entry("b"), entry("drawer_b", "open_drawer")]
    assert [one.names for one in within(entries)] == [("a", "b"), ("drawer_a", "drawer_b")]
    assert [one.names for one in within([entry("a"), entry("b", "other")])] == [("a", "b")]


def test_evaluations_are_compared_entry_by_entry_and_named_by_what_differs(tmp_path: Path) -> None:
    both = [entry("a"), entry("b")]
    sides = (str(tmp_path / "first"), str(tmp_path / "second"))
    assert [one.names for one in matched(both, both, sides)] == [("first:a", "second:a"), ("first:b", "second:b")]
    assert [one.names for one in matched(both[:1], both[:1], sides)] == [("first", "second")]
    assert [one.names for one in matched([entry("a")], [entry("b")], sides)] == [("a", "b")]
    with pytest.raises(ConfigurationError, match="name one as FOLDER:ENTRY"):
        matched(both, [entry("c"), entry("d")], sides)
    with pytest.raises(ConfigurationError, match="is compared with itself"):
        matched(both, both, (sides[0], sides[0]))


def test_a_table_of_differences_has_a_line_for_each_comparison_and_shows_what_is_significant() -> None:
    failing = FinishedEntry("c", "fetch_cup", tuple(run(seed, success=seed < 3) for seed in range(8)))
    header, rule, second, third = differences_table(within([entry("a"), entry("b", shift=2.0), failing]))
    assert header == "|  | success, percentage points | error | drive_s | time_s |"
    assert rule.count("---") == 5
    assert second == ("| b against a | +0 (-32 to +32) | **+2.0 (+2.0 to +2.0)** | +0 (+0 to +0) | +0 (+0 to +0) |")
    assert third == "| c against a | -62 (-86 to -10) | – | +0 | +0 |"


def test_a_bar_in_the_name_of_an_entry_does_not_end_a_cell() -> None:
    *_, row = differences_table(within([entry("a"), entry("b|c")]))
    assert row.startswith(r"| b\|c against a | +0 (")


def test_long_names_in_a_picture_are_shortened_where_they_are_alike() -> None:
    assert short_names("grid_astar", "rrt_star") == ["grid_astar", "rrt_star"]
    assert short_names("x" * 30, "y") == [f"{'x' * 21}…", "y"]
    shortened = short_names("algorithms.motion_planning.rrt_connect", "algorithms.motion_planning.bit_star")
    assert shortened == ["…_planning.rrt_connect", "…ion_planning.bit_star"]
    first, second = (f"/data/shared/evaluations/{side}/with/a/very/long/name" for side in ("one", "two"))
    assert short_names(first, second) == ["…one/with/a/very/long…", "…two/with/a/very/long…"]


@pytest.mark.slow
def test_an_evaluation_is_read_from_its_folder_entry_by_entry(tmp_path: Path) -> None:
    finished_evaluation(tmp_path / "mine", {"rrt": RRT, "bit": BIT})

    rrt, bit = read_entries(str(tmp_path / "mine"))

    assert (rrt.name, rrt.task, rrt.settings) == ("rrt", "fetch_cup", dict([RRT.split("=")]))
    assert [result.seed for result in bit.results] == [5, 6, 7, 8, 9, 10]
    assert read_entries(f"{tmp_path / 'mine'}:bit") == [bit]
    with pytest.raises(ConfigurationError, match="no entry 'bot'; did you mean 'bit'"):
        read_entries(f"{tmp_path / 'mine'}:bot")
    with pytest.raises(ConfigurationError, match="it has no summary.json"):
        read_entries(str(tmp_path))


def test_what_is_written_of_an_evaluation_holds_no_secret_of_a_controller(tmp_path: Path) -> None:
    finished_evaluation(tmp_path, {"arm": "robot.connections.arm.token=HIDDEN", "rrt": RRT})
    arm, _ = read_entries(str(tmp_path))
    assert arm.settings == {"robot.connections.arm.token": "…"}
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert written
    assert not [path for path in written if b"HIDDEN" in path.read_bytes()]


@pytest.mark.slow
def test_a_picture_has_a_panel_for_success_and_each_metric_with_a_line_per_pair(tmp_path: Path) -> None:
    (compared,) = within([entry("a"), entry("b", shift=1.0)])
    compared.draw(tmp_path / "picture.svg")
    compared.draw(tmp_path / "picture.png")

    groups = [e.get("id", "") for e in ET.parse(tmp_path / "picture.svg").iter() if e.get("id", "").startswith("axes_")]
    assert len(groups) == 4  # success, error, drive_s, time_s
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")


def test_of_several_old_codes_the_last_one_in_the_journal_counts(tmp_path: Path) -> None:
    config = load_run("fetch_cup", seed=5)
    with Journal(tmp_path / "episodes.jsonl") as journal:
        for code, sim_time in (("b", 1.0), ("a", 2.0)):
            key = EpisodeKey(config_fingerprint(config), 5, code)
            journal.add(key, "", replace(result(5), sim_time_s=sim_time))
    with Evaluation(Suite("mine", (SuiteEntry("one", config, 1),)), tmp_path, keep_old=True) as evaluation:
        (tmp_path / "summary.json").write_text(json.dumps(evaluation.document()))
        (counted,) = evaluation.finished_entries()
    (found,) = read_entries(str(tmp_path))
    assert [one.sim_time_s for one in (*counted.results, *found.results)] == [2.0, 2.0]
