from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours.failure import NodeFailure
from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.summary import summarize


def result(seed: int, *, tree: str = "SUCCESS", predicate: bool | None = True, teleports: int = 0) -> RunResult:
    success = tree == "SUCCESS" and predicate is True
    failure = None if success else NodeFailure("pick/Grasp", "missed", "the hand closed on nothing")
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
    assert wilson_interval(2, 50) == pytest.approx((1 - 0.9890, 1 - 0.8654), abs=1e-4)
    assert wilson_interval(0, 0) == (0.0, 1.0)
    for successes in (4, -1):
        with pytest.raises(ValueError, match=f"trials = 3 but is {successes}"):
            wilson_interval(successes, 3)


@settings(deadline=None, derandomize=True)
@given(st.integers(1, 200).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_an_interval_holds_its_share_and_more_of_the_same_makes_it_narrower(counted):
    successes, trials = counted
    low, high = wilson_interval(successes, trials)
    assert 0.0 <= low <= successes / trials <= high <= 1.0
    narrow_low, narrow_high = wilson_interval(4 * successes, 4 * trials)
    assert narrow_high - narrow_low < high - low


def test_a_tree_that_claims_success_against_the_judge_is_a_false_success():
    document = summarize("fetch_cup", 7, [result(7), result(8, predicate=False)], 9.0)
    assert document["succeeded"] == 1
    assert document["false_successes"] == 1
    assert [failure["seed"] for failure in document["failures"]] == [8]


def test_successes_that_are_not_the_robots_are_counted_and_reported():
    held = replace(result(7), held_at_start=True)
    moved = replace(result(8), held_at_start=False, moved_by_others=["cup"])
    failed = replace(result(9, predicate=False), held_at_start=True, moved_by_others=["cup"])
    document = summarize("fetch_cup", 7, [held, moved, failed], 9.0)
    assert (document["succeeded"], [one["seed"] for one in document["unearned"]]) == (2, [7, 8])
    assert document["unearned"][1]["why"] == "a disturbance moved the cup; the robot never touched it"


def test_every_count_of_a_batch_is_of_its_own_kind():
    """Two successes, a failure, a false success, an error and one that nobody judged."""
    error = replace(result(12, tree="IDLE", predicate=None), outcome=Outcome.ERROR, failure=None, sim_time_s=0.0)
    unjudged = replace(result(13, predicate=None), success=True, outcome=Outcome.SUCCESS, failure=None)
    failed = result(9, tree="FAILURE", predicate=False)
    results = [result(7), result(8), failed, result(10, predicate=False), error, unjudged]
    document = summarize("fetch_cup", 7, results, 9.0)
    assert (document["task"], document["first_seed"], document["episodes"]) == ("fetch_cup", 7, 6)
    assert (document["succeeded"], document["success_rate"]) == (3, 0.5)
    assert document["interval"] == [round(bound, 4) for bound in wilson_interval(3, 6)]
    assert (document["errors"], document["false_successes"]) == (1, 1)
    assert [failure["seed"] for failure in document["failures"]] == [9, 10, 12]
    assert document["failures"][-1] == {
        "seed": 12, "node": "", "error_code": "error", "why": "the run was not judged a success",
    }  # fmt: skip
    assert document["causes"] == {"missed": 2, "error": 1}
    assert (document["sim_time_s"], document["wall_time_s"]) == (200.0, 9.0)
    assert document["real_time_factor"] == round(200.0 / 24.0, 3), "per process, not of the whole batch"


def test_a_batch_of_nothing_has_no_share_and_no_slowest():
    document = summarize("t", 0, [], 0.0)
    assert (document["success_rate"], document["interval"], document["slowest"]) == (0.0, [0.0, 1.0], None)
    assert (document["real_time_factor"], document["metrics"], document["causes"]) == (0.0, {}, {})


@pytest.mark.parametrize("cheat", CHEATS)
def test_any_cheat_makes_the_audit_of_a_batch_unclean(cheat):
    cheated = replace(result(1), audit={**result(1).audit, cheat: 1})
    document = summarize("t", 0, [result(0), cheated, result(2)], 1.0)
    assert (document["audit_clean"], document["unclean_seeds"]) == (False, [1])


def test_one_teleport_in_one_episode_makes_the_audit_unclean_and_a_collision_does_not():
    assert summarize("t", 0, [result(0), result(1)], 1.0)["audit_clean"] is True
    assert summarize("t", 0, [result(0), result(1, teleports=1)], 1.0)["audit_clean"] is False


def test_metrics_are_medians_and_95th_percentiles():
    document = summarize("t", 0, [result(seed) for seed in range(101)], 1.0)
    assert document["metrics"] == {"place_error_mm": {"median": 50.0, "interval": [40.0, 60.0], "p95": 95.0}}, (
        "a tilt of NaN was not measured"
    )
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
    assert document["accuracy"]["place_error_mm"] == {"median": 4.0, "interval": None, "p95": 4.9}


def test_causes_are_counted_the_most_frequent_first_and_the_slowest_run_is_named():
    failed = [result(seed, predicate=False) for seed in range(3)]
    other = replace(failed[0], seed=9, failure=NodeFailure("a", "no_grasp", "…"), sim_time_s=90.0)
    document = summarize("t", 0, [other, *failed], 1.0)
    assert document["causes"] == {"missed": 3, "no_grasp": 1}
    assert document["slowest"] == {"seed": 9, "sim_time_s": 90.0}


def test_the_seeds_of_unclean_audits_are_named():
    assert summarize("t", 0, [result(0), result(1, teleports=1)], 1.0)["unclean_seeds"] == [1]


def test_a_metric_that_was_not_measured_stays_so_when_it_is_read_back():
    read = RunResult.from_document(json.loads(json.dumps(result(1).to_document())))
    assert math.isnan(read.metrics["tilt_deg"])
    assert read.metrics["place_error_mm"] == 1.0
    assert (read.outcome, read.failure) == (Outcome.SUCCESS, None)
    assert read.real_time_factor == 10.0
    assert replace(read, wall_time_s=0.0).real_time_factor == 0.0


def test_a_result_is_read_back_from_its_document():
    there = result(4, predicate=False).to_document()
    assert RunResult.from_document(json.loads(json.dumps(there))).to_document() == there
