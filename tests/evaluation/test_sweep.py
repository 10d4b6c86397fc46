"""Sweeps: every combination of settings becomes an entry of its own, with the same seeds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunRequest
from bestman_bt.evaluation.finished_evaluation import FinishedEntry
from bestman_bt.evaluation.suite import Suite, make_suite
from bestman_bt.evaluation.sweep import combinations, draw_settings, sweep_suite
from tests.evaluation.test_summary import result

FRICTION, RATE = "scene.finger_friction", "tick_rate"


@pytest.mark.parametrize(
    ("settings", "together", "expected"),
    [
        (["a=1,2", "b=x", "c=3, 4"], False, ["a=1 b=x c=3", "a=1 b=x c=4", "a=2 b=x c=3", "a=2 b=x c=4"]),
        (["a=1,2", "b=x", "c=3,4"], True, ["a=1 b=x c=3", "a=2 b=x c=4"]),
        (["a=[1, 2],[3, 4]", "b={x: 1, y: 2}"], False, ["a=[1, 2] b={x: 1, y: 2}", "a=[3, 4] b={x: 1, y: 2}"]),
    ],
)
def test_settings_with_several_values_are_combined(settings: list[str], together: bool, expected: list[str]) -> None:
    assert [" ".join(one) for one in combinations(settings, together)] == expected


@pytest.mark.parametrize(
    ("settings", "together", "why"),
    [
        ([], False, "no setting has several values"),
        (["a=1"], False, "no setting has several values"),
        (["a=1,2", "b=1,2,3"], True, "the same number of values for each setting, got 2, 3"),
    ],
)
def test_a_sweep_of_nothing_is_refused(settings: list[str], together: bool, why: str) -> None:
    with pytest.raises(ConfigurationError, match=why):
        combinations(settings, together)


def made(settings: tuple[str, ...]) -> Suite:
    return make_suite(["fetch_cup"], 3, 40, RunRequest(settings=settings))


@pytest.mark.parametrize(
    ("settings", "same"),
    [
        ([f"{RATE}=10,10.0"], f"{RATE}=10 and {RATE}=10.0 are the same run"),
        ([f"{RATE}=10,20", f"{RATE}=5,6"], f"{RATE}=10, {RATE}=5 and {RATE}=20, {RATE}=5 are the same run"),
    ],
)
def test_two_combinations_that_are_the_same_run_are_refused(settings: list[str], same: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        sweep_suite(made, combinations(settings))
    assert f"--set: {same}" in map(str, refused.value.problems)


def test_an_entry_is_named_after_what_differs_and_has_the_same_seeds() -> None:
    suite = sweep_suite(made, combinations([f"{FRICTION}=0.5,0.9", f"{RATE}=20 Hz"]))
    assert suite.name == "fetch_cup_sweep"
    assert [entry.name for entry in suite.entries] == ["finger_friction=0.5", "finger_friction=0.9"]
    assert [entry.settings for entry in suite.entries] == [{FRICTION: "0.5"}, {FRICTION: "0.9"}]
    assert [[config.seed for config in entry.configs()] for entry in suite.entries] == [[40, 41, 42]] * 2
    assert [entry.configs()[0].entry for entry in suite.entries] == [entry.name for entry in suite.entries]
    assert [entry.config.scene_settings for entry in suite.entries] == [
        {"finger_friction": 0.5},
        {"finger_friction": 0.9},
    ]


def test_all_wrong_values_are_refused_at_once() -> None:
    with pytest.raises(ConfigurationError) as refused:
        sweep_suite(made, combinations([f"{FRICTION}=0.5,hard,soft"]))
    assert ["hard" in str(problem) or "soft" in str(problem) for problem in refused.value.problems] == [True, True]


def test_the_picture_has_success_and_every_metric(tmp_path: Path) -> None:
    entries = [
        FinishedEntry(name, "t", tuple(replace(result(s), metrics={"error_mm": s * k}) for s in (1, 2)), {"x.k": name})
        for k, name in ((1.0, "one"), (2.0, "two"))
    ]
    draw_settings(tmp_path / "a.svg", entries)
    text = (tmp_path / "a.svg").read_text()
    assert all(f"<!-- {word} -->" in text for word in ("success", "error_mm", "k=one", "k=two"))
