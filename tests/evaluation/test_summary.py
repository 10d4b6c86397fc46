from __future__ import annotations

import json
from dataclasses import replace

import pytest

from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.evaluation.result import FailureReport, Outcome, RunResult
from bestman_bt.evaluation.summary import summarize


def result(seed: int, *, tree: str = "SUCCESS", predicate: bool | None = True, teleports: int = 0) -> RunResult:
    success = tree == "SUCCESS" and predicate is True
    failure = None if success else FailureReport("pick/Grasp", "missed", "the hand closed on nothing")
    return RunResult(
        task="fetch_cup",
        seed=seed,
        success=success,
        outcome=Outcome.SUCCESS if success else Outcome.FAILURE,
        tree_status=tree,
        predicate=predicate,
        failure=failure,
        audit={**dict.fromkeys(CHEATS, 0), "teleports": teleports, "collisions": 1},
        metrics={"place_error_mm": float(seed), "tilt_deg": float("nan")},
        sim_time_s=40.0,
        wall_time_s=4.0,
    )


def test_wilson_interval_agrees_with_the_textbook():
    low, high = wilson_interval(48, 50)
    assert (low, high) == pytest.approx((0.8654, 0.9890), abs=1e-4)
    assert wilson_interval(0, 0) == (0.0, 1.0)
    with pytest.raises(ValueError, match="trials = 3"):
        wilson_interval(4, 3)


def test_a_tree_that_claims_success_against_the_judge_is_a_false_success():
    document = summarize("fetch_cup", 7, [result(7), result(8, predicate=False)], 9.0)
    assert document["succeeded"] == 1
    assert document["false_successes"] == 1
    assert [failure["seed"] for failure in document["failures"]] == [8]


def test_one_teleport_in_one_episode_makes_the_audit_unclean_and_a_collision_does_not():
    assert summarize("t", 0, [result(0), result(1)], 1.0)["audit_clean"] is True
    assert summarize("t", 0, [result(0), result(1, teleports=1)], 1.0)["audit_clean"] is False


def test_metrics_are_medians_and_95th_percentiles():
    document = summarize("t", 0, [result(seed) for seed in range(101)], 1.0)
    assert document["metrics"]["place_error_mm"] == {"median": 50.0, "p95": 95.0}
    assert document["real_time_factor"] == 10.0


def test_the_result_document_is_strict_json():
    text = json.dumps(result(1).to_document(), allow_nan=False)
    assert json.loads(text)["metrics"]["tilt_deg"] is None


def test_a_run_without_an_audit_is_not_clean():
    blind = replace(result(0), audit={})
    assert summarize("t", 0, [blind], 1.0)["audit_clean"] is False


def test_accuracy_is_that_of_the_runs_whose_tree_claims_success_true_or_not():
    results = [result(3), result(5, predicate=False), result(2000, tree="FAILURE")]
    document = summarize("t", 0, results, 1.0)
    assert document["metrics"]["place_error_mm"]["median"] == 5.0
    assert document["accuracy"]["place_error_mm"] == {"median": 4.0, "p95": 4.9}


def test_causes_are_counted_the_most_frequent_first_and_the_slowest_run_is_named():
    failed = [result(seed, predicate=False) for seed in range(3)]
    other = replace(failed[0], seed=9, failure=FailureReport("a", "no_grasp", "…"), sim_time_s=90.0)
    document = summarize("t", 0, [other, *failed], 1.0)
    assert document["causes"] == {"missed": 3, "no_grasp": 1}
    assert document["slowest"] == {"seed": 9, "sim_time_s": 90.0}


def test_the_seeds_of_unclean_audits_are_named():
    assert summarize("t", 0, [result(0), result(1, teleports=1)], 1.0)["unclean_seeds"] == [1]


def test_a_result_is_read_back_from_its_document():
    there = result(4, predicate=False).to_document()
    assert RunResult.from_document(json.loads(json.dumps(there))).to_document() == there
