"""Evaluations: a suite goes on where it was interrupted, notices changed code, and tells what was met."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.task import load_task
from bestman_bt.evaluation import evaluation as evaluation_module
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.markdown import markdown
from bestman_bt.evaluation.report.page import groups_by_name
from bestman_bt.evaluation.report.run_reader import folders_to_report, read_run_report
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.suite import SuiteEntry, is_suite, load_suite

pytestmark = pytest.mark.slow

NOTHING = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysFailure/></BehaviorTree></root>'
SUITE = """
description: A suite of a tree that does nothing.
first_seed: 3
episodes: 3
tasks:
  fail:
    task: fetch_cup
    settings: [tree={folder}/nothing.xml]
    successes: {{at_least: 2, of: 3}}
controls:
  control:
    task: fetch_cup
    settings: [tree={folder}/nothing.xml, scene.finger_friction=0.001]
    episodes: 1
    successes: {{at_most: 0, of: 1}}
"""


@pytest.fixture
def suite_file(tmp_path: Path) -> Path:
    (tmp_path / "nothing.xml").write_text(NOTHING)
    path = tmp_path / "mine.yaml"
    path.write_text(SUITE.format(folder=tmp_path))
    return path


def evaluate(path: Path, folder: Path, stop_after: int = 99, **options: Any) -> tuple[list[str], dict[str, Any]]:
    """Which episodes were run, and the document."""
    ran: list[str] = []

    def told(entry: SuiteEntry, result: RunResult) -> None:
        ran.append(f"{entry.name} {result.seed}")
        if len(ran) == stop_after:
            os.kill(os.getpid(), signal.SIGINT)

    with Evaluation(load_suite(path), folder, **options) as evaluation:
        return ran, evaluation.run(on_result=told)


def test_an_interrupted_evaluation_goes_on_where_it_stopped(suite_file: Path, tmp_path: Path) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        ran, document = evaluate(suite_file, tmp_path / "out", stop_after=2)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ran == ["fail 3", "fail 4"]
    assert (document["interrupted"], document["met"], document["episodes"]) == (True, False, 2)
    assert "**Interrupted, 2 of 4 episodes completed.**" in markdown(document)
    ran, document = evaluate(suite_file, tmp_path / "out")
    assert ran == ["fail 5", "control 3"]
    assert (document["interrupted"], document["episodes"], document["notes"]) == (False, 4, [])
    task, control = document["entries"]
    assert [(entry["episodes"], entry["succeeded"], entry["met"]) for entry in (task, control)] == [
        (3, 0, False),
        (1, 0, True),
    ]
    assert [failure["seed"] for failure in task["failures"]] == [3, 4, 5]
    assert evaluate(suite_file, tmp_path / "out")[0] == []
    rows = groups_by_name([read_run_report(folder) for folder in folders_to_report(tmp_path / "out")])
    assert [name.split(" · ")[0] for name in rows] == ["fail", "control"]
    text = markdown(document)
    assert "**Not all targets met.** 4 episodes, 0 false successes, 0 unearned successes, audit clean." in text
    assert "missed: successes 0 of 3, asked ≥ 2 of 3" in text


def test_episodes_of_other_code_are_reported_and_run_again_unless_they_are_kept(
    suite_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    evaluate(suite_file, tmp_path / "out")
    monkeypatch.setattr(evaluation_module, "code_fingerprint", lambda: "other")
    ran, document = evaluate(suite_file, tmp_path / "out", keep_old=True)
    assert ran == []
    assert document["notes"] == ["4 finished episodes were run with other code and count all the same"]
    ran, document = evaluate(suite_file, tmp_path / "out")
    assert len(ran) == 4
    assert document["notes"] == [
        "4 finished episodes were run with other code and are run again; --keep-old counts them"
    ]


def test_another_tree_is_another_episode(suite_file: Path, tmp_path: Path) -> None:
    evaluate(suite_file, tmp_path / "out")
    (tmp_path / "nothing.xml").write_text(NOTHING.replace("AlwaysFailure", "AlwaysSuccess"))
    ran, document = evaluate(suite_file, tmp_path / "out")
    assert len(ran) == 4
    assert document["false_successes"] == 4
    assert not any(entry["met"] for entry in document["entries"])


def test_all_faults_of_a_suite_are_reported_at_once(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(
        "tasks:\n"
        "  fetch_cop: {successes: {at_least: 1, of: 2}}\n"
        "  fetch_cup: {successes: {at_least: 3, of: 2}}\n"
        "  other: {task: fetch_cup, successes: {of: 2}}\n"
        "controls:\n"
        "  other: {task: fetch_cup, settings: [scene.finger_fraction=1], successes: {at_most: 0, of: 2}}\n"
        "  mine: {task: mine.yaml, settings: [algorithms.global_planning.algorithm=theta_sta, tick_rat=3]}\n"
        "  lost: {task: fetch_cup, tree: no.xml, successes: {at_most: 0, of: 2, off: 1}, causes: [grasp_lost, 3]}\n"
        "  renamed: {task: fetch_cup, successes: {at_most: 3, of: 2}}\n"
    )
    (tmp_path / "mine.yaml").write_text(
        "tree: navigate\nscene: kitchen\nrobot: diff_panda\ngoals: [{at_goal: {to: 3}}]\npredicate: arrived\n"
    )
    with pytest.raises(ConfigurationError) as caught:
        load_suite(path)
    told = str(caught.value)
    assert "unknown task 'fetch_cop'; did you mean 'fetch_cup'?" in told
    assert "bad.yaml:3: tasks.fetch_cup.successes: exceeds the number of episodes, 2" in told
    assert "bad.yaml:4: tasks.other.successes: one of 'at_least' and 'at_most' should be given" in told
    assert "bad.yaml:6: controls.other: is also the name of a task of this suite" in told
    assert "finger_fraction" in told
    assert "bad.yaml:7: controls.mine.settings[0]: unknown algorithm 'theta_sta'; did you mean 'theta_star'?" in told
    assert "bad.yaml:7: controls.mine.settings[1]: unknown key 'tick_rat'; did you mean 'tick_rate'?" in told
    assert "bad.yaml:8: controls.lost.tree: no such tree file" in told
    assert "bad.yaml:8: controls.lost.successes.off: unknown field" in told
    assert "bad.yaml:8: controls.lost.causes[1]: should be text, got 3" in told
    assert "controls.lost.successes: " not in told
    assert "bad.yaml:9: controls.renamed.successes: exceeds the number of episodes, 2" in told
    assert "mine.yaml:4: goals[0].at_goal.to: unknown field" in told
    assert "mine.yaml:5: predicate: unknown predicate 'arrived'" in told


def test_a_suite_is_told_from_a_task() -> None:
    assert [is_suite(name) for name in ("manipulation", "fetch_cup")] == [True, False]


def test_the_shipped_suites_load_and_ask_something_of_every_judged_task() -> None:
    suites = [load_suite(name) for name in data_names("evaluation")]
    asked = {entry.config.name for suite in suites for entry in suite.entries if not entry.control}
    assert asked == {name for name in data_names("task") if load_task(name).predicates}


def test_the_suite_of_manipulation_has_its_own_seeds_and_controls_that_may_not_succeed() -> None:
    suite = load_suite("manipulation")
    assert all(entry.config.seed == 14000 for entry in suite.entries)
    for entry in suite.entries:
        assert entry.asked is not None
        assert (entry.asked.successes.at_most == 0) == entry.control


@pytest.mark.parametrize("policy", ["policy_reach", "policy_pick"])
@pytest.mark.parametrize("altered", ["null", "wrong_goal"])
def test_an_altered_policy_fails_for_the_reason_that_its_control_names(policy: str, altered: str) -> None:
    (entry,) = (entry for entry in load_suite("manipulation").entries if entry.name == f"{policy}_{altered}")
    assert entry.asked is not None
    result = run_episode(entry.config)
    assert result.outcome == "failure"
    assert result.failure is not None
    assert result.failure.error_code in entry.asked.causes
