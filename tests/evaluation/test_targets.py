"""Targets: met or missed, by share where the number of runs is another one."""

from __future__ import annotations

from typing import Any

import pytest

from bestman_bt.evaluation.suite import EntryConfig, Spread, Successes, check_targets, load_suite


def summary(succeeded: int, episodes: int, **other: Any) -> dict[str, Any]:
    there = {
        "succeeded": succeeded,
        "episodes": episodes,
        "accuracy": {},
        "real_time_factor": 7.0,
        "errors": 0,
        "causes": {},
        "false_successes": 0,
        "audit_clean": True,
        "unclean_seeds": [],
    }
    return {**there, **other}


def missed(asked: EntryConfig, found: dict[str, Any]) -> list[str]:
    return [target.what for target in check_targets(asked, found) if not target.met]


@pytest.mark.parametrize(
    ("succeeded", "episodes", "met"), [(19, 20, True), (18, 20, False), (48, 50, True), (47, 50, False), (0, 0, False)]
)
def test_at_least_19_of_20_is_95_percent_of_any_number(succeeded: int, episodes: int, met: bool) -> None:
    asked = EntryConfig(Successes(20, at_least=19))
    assert missed(asked, summary(succeeded, episodes)) == ([] if met else ["successes"])


@pytest.mark.parametrize(
    ("succeeded", "episodes", "met"), [(1, 10, True), (2, 10, False), (2, 20, True), (3, 20, False)]
)
def test_at_most_1_of_10_is_a_tenth_of_any_number(succeeded: int, episodes: int, met: bool) -> None:
    asked = EntryConfig(Successes(10, at_most=1))
    assert missed(asked, summary(succeeded, episodes)) == ([] if met else ["successes"])


@pytest.mark.parametrize(("succeeded", "episodes", "met"), [(0, 10, True), (1, 10, False), (0, 0, False)])
def test_a_control_that_succeeds_once_is_missed(succeeded: int, episodes: int, met: bool) -> None:
    asked = EntryConfig(Successes(10, at_most=0))
    assert missed(asked, summary(succeeded, episodes)) == ([] if met else ["successes"])


def test_accuracy_is_held_to_median_and_p95_and_missed_where_it_was_not_measured() -> None:
    asked = EntryConfig(Successes(20, at_least=0), accuracy={"place_error_mm": Spread(8.0, 20.0)})
    for median, p95, words in (
        (8.0, 20.0, []),
        (7.9, 20.1, ["place_error_mm p95"]),
        (8.1, 19.9, ["place_error_mm median"]),
    ):
        measured = {"place_error_mm": {"median": median, "p95": p95}}
        assert missed(asked, summary(20, 20, accuracy=measured)) == words
    only_p95 = EntryConfig(Successes(20, at_least=0), accuracy={"place_error_mm": Spread(p95=20.0)})
    assert missed(only_p95, summary(20, 20, accuracy={"place_error_mm": {"median": 99.0, "p95": 20.0}})) == []
    assert missed(asked, summary(20, 20, metrics={"place_error_mm": {"median": 1.0, "p95": 1.0}}))
    assert missed(asked, summary(20, 20)) == ["place_error_mm median", "place_error_mm p95"]


def test_false_successes_and_cheats_are_missed_targets_of_every_entry() -> None:
    asked = EntryConfig(Successes(20, at_least=19), real_time_factor=6.0)
    found = summary(20, 20, false_successes=1, audit_clean=False, real_time_factor=5.9)
    assert missed(asked, found) == ["real-time factor", "false successes", "audit"]
    assert missed(asked, summary(20, 20, real_time_factor=6.0)) == []
    for fault in ({"false_successes": 1}, {"errors": 1}, {"audit_clean": False}):
        assert len(missed(asked, summary(20, 20, **fault))) == 1


def test_a_run_that_raised_is_a_missed_target_even_of_a_control() -> None:
    asked = EntryConfig(Successes(10, at_most=0))
    assert missed(asked, summary(0, 10, errors=1)) == ["errors"]


def test_a_control_that_fails_for_another_cause_than_it_should_is_missed() -> None:
    asked = EntryConfig(Successes(10, at_most=0), causes=("grip_lost", "jammed"))
    assert missed(asked, summary(0, 10, causes={"grip_lost": 7, "jammed": 3})) == []
    (target,) = [t for t in check_targets(asked, summary(0, 10, causes={"no_stand": 2, "jammed": 8})) if not t.met]
    assert (target.what, target.found) == ("causes", "2 no_stand")


@pytest.mark.slow
def test_every_shipped_control_names_the_causes_that_it_may_fail_with() -> None:
    controls = [entry for entry in load_suite("manipulation").entries if entry.control]
    assert len(controls) == 7
    assert [entry.name for entry in controls if entry.asked is None or not entry.asked.causes] == []
