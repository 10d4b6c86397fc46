"""Paired statistics against values of the literature and of other implementations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from behaviours.failure import NodeFailure
from bestman_bt.evaluation.comparison import metric_sentence, sentences, success_sentence
from bestman_bt.evaluation.paired_comparison import (
    compare_runs,
    compare_successes,
    compare_values,
    hodges_lehmann,
    tango_interval,
)
from bestman_bt.evaluation.result import Outcome, RunResult

BEFORE = [1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30]
AFTER = [0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29]
"""Depression scores of nine patients, Hollander and Wolfe 1973, table 3.1."""


def run(seed: int, success: bool = True, drive: float = 20.0, **metrics: float) -> RunResult:
    return RunResult(
        task="fetch_cup",
        seed=seed,
        success=success,
        outcome=Outcome.SUCCESS if success else Outcome.FAILURE,
        tree_status="SUCCESS" if success else "FAILURE",
        predicate=success,
        failure=None if success else NodeFailure("pick/Grasp", "missed", "the hand closed on nothing"),
        audit={},
        metrics=metrics,
        sim_time_s=40.0,
        wall_time_s=4.0,
        durations={"drive_s": drive},
    )


def test_signed_ranks_agree_with_the_textbook() -> None:
    """R: wilcox.test(y - x, conf.int = TRUE) gives p = 0.03906, -0.46, -0.786 to -0.010."""
    metric = compare_values("score", range(9), BEFORE, AFTER)
    assert metric.p_value == pytest.approx(0.0390625)
    assert metric.shift == pytest.approx(-0.46)
    assert metric.interval == pytest.approx((-0.786, -0.010))


def test_the_interval_of_a_shift_holds_it_in_nineteen_of_twenty_samples_and_is_none_with_five() -> None:
    rng = np.random.default_rng(3)
    for count in (8, 150):
        samples = [hodges_lehmann(rng.normal(0.3, 1.0, count))[1] for _ in range(300)]
        held = sum(bounds is not None and bounds[0] <= 0.3 <= bounds[1] for bounds in samples)
        assert 0.92 <= held / 300 <= 0.99
    assert hodges_lehmann(np.arange(5.0))[1] is None
    assert hodges_lehmann(np.arange(6.0)) == (2.5, (0.0, 5.0))


def test_mcnemar_is_the_binomial_test_of_the_pairs_that_differ() -> None:
    """Of 2 and 12 that differ: 2 * sum(C(14, k) for k <= 2) / 2**14 = 0.0129."""
    success = compare_successes(36 * [(True, True)] + 2 * [(True, False)] + 12 * [(False, True)])
    assert success.p_value == pytest.approx(2 * (1 + 14 + 91) / 2**14)
    assert (success.pairs, success.difference) == (50, 0.2)
    assert compare_successes([(True, True), (False, False)]).p_value == 1.0


@pytest.mark.parametrize(("only_first", "only_second", "pairs"), [(2, 12, 50), (0, 3, 10), (4, 4, 20), (7, 1, 9)])
def test_the_interval_of_a_difference_ends_where_the_score_test_rejects(
    only_first: int, only_second: int, pairs: int
) -> None:
    """The restricted estimate is found here by maximising the likelihood."""

    def score(difference: float) -> float:
        def minus_log_likelihood(share: float) -> float:
            shares = share + difference, share, 1 - 2 * share - difference
            counts = only_second, only_first, pairs - only_first - only_second
            return -sum(n * math.log(max(p, 1e-300)) for p, n in zip(shares, counts, strict=True))

        bounds = (max(0.0, -difference), (1 - difference) / 2)
        share = minimize_scalar(minus_log_likelihood, bounds=bounds, method="bounded", options={"xatol": 1e-10}).x
        variance = pairs * (2 * share + difference - difference**2)
        return (only_second - only_first - pairs * difference) / math.sqrt(variance)

    low, high = tango_interval(only_first, only_second, pairs)
    assert score(low) == pytest.approx(1.96, abs=1e-3)
    assert score(high) == pytest.approx(-1.96, abs=1e-3)


def test_an_interval_that_reaches_the_end_ends_there() -> None:
    assert tango_interval(0, 10, 10)[1] == 1.0
    low, high = tango_interval(0, 0, 10)
    assert low == pytest.approx(-high)


def test_the_number_of_pairs_that_would_decide_is_that_of_the_power_analysis() -> None:
    """Shares 0.25 and 0.05: (1.96 √0.3 + 0.842 √(0.3 - 0.04))² / 0.04 = 56.4 (Connor 1987)."""
    success = compare_successes(5 * [(False, True)] + [(True, False)] + 14 * [(True, True)])
    assert success.pairs_needed == 57
    assert compare_successes([(True, False), (False, True)]).pairs_needed is None


def test_runs_are_paired_by_seed_and_metrics_count_where_both_succeeded() -> None:
    first = [run(seed, success=seed != 2, error=float(seed)) for seed in (3, 1, 2, 9)]
    second = [run(seed, error=seed + 1.0, drive=18.0) for seed in (1, 2, 3, 4)]

    compared = compare_runs(first, second)

    assert (compared.success.both, compared.success.only_second, compared.unpaired) == (2, 1, (4, 9))
    error, drive, time = compared.metrics
    assert (error.name, error.seeds, error.first, error.second) == ("error", (1, 3), (1.0, 3.0), (2.0, 4.0))
    assert (drive.name, drive.shift, time.name) == ("drive_s", -2.0, "time_s")
    with pytest.raises(ValueError, match="no seed is in both"):
        compare_runs(first, [run(100)])


def test_cancelled_runs_of_either_side_are_not_compared() -> None:
    cancelled = [replace(run(seed, success=False), outcome=Outcome.CANCELLED) for seed in (1, 2, 3)]
    compared = compare_runs([run(1), cancelled[1], run(3), run(4)], [cancelled[0], run(2), cancelled[2], run(4)])
    assert (compared.success.pairs, compared.success.both, compared.unpaired) == (1, 1, (1, 2, 3))


def test_p_values_of_several_metrics_are_corrected() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(10, 2))
    first = [run(seed, a=0.0, b=0.0) for seed in range(10)]
    second = [run(seed, a=5 + noise[seed, 0], b=noise[seed, 1]) for seed in range(10)]

    a, b, drive, time = compare_runs(first, second).metrics

    assert a.adjusted_p == pytest.approx(4 * a.p_value)
    assert b.adjusted_p == min(1.0, 3 * b.p_value)
    assert drive.adjusted_p == time.adjusted_p == 1.0


def test_no_corrected_p_value_is_below_one_of_a_smaller_p_value() -> None:
    first = [run(seed, a=0.0, b=0.0) for seed in range(10)]
    second = [run(seed, a=5.0 + seed, b=5.0 + seed) for seed in range(10)]

    a, b, *_ = compare_runs(first, second).metrics

    assert a.p_value == b.p_value < 0.01
    assert a.adjusted_p == b.adjusted_p == pytest.approx(4 * a.p_value)


def test_one_sentence_reports_whether_a_difference_is_shown_and_how_many_pairs_would_decide() -> None:
    undecided = compare_successes(5 * [(False, True)] + [(True, False)] + 14 * [(True, True)])
    assert success_sentence(undecided, "rrt", "bit") == (
        "success: no difference shown: rrt 15 of 20, bit 19 of 20, difference +20 percentage points "
        "(95 % interval -5 to +44), McNemar's test p = 0.2, 20 pairs; about 40 more would decide."
    )
    shown = compare_successes(12 * [(False, True)] + 8 * [(True, True)])
    assert success_sentence(shown, "rrt", "bit").startswith("success: higher with bit than with rrt: rrt 8 of 20")


def test_a_metric_is_written_with_the_digits_that_its_interval_allows() -> None:
    text = metric_sentence(compare_values("score", range(9), BEFORE, AFTER), "before", "after")
    assert text == (
        "score: larger with before than with after: "
        "after − before = -0.46 (95 % interval -0.79 to -0.01), p = 0.039, 9 pairs."
    )
    few = metric_sentence(compare_values("error_mm", range(4), [1, 2, 3, 4], [1.5, 1.5, 3.5, 4.0]), "a", "b")
    assert "no interval from fewer than 6 pairs" in few
    assert few.endswith("4 pairs; about 120 more would decide.")
    assert (
        metric_sentence(compare_values("same", [1, 2], [1, 1], [1, 1]), "a", "b")
        == "same: the same in each of the 2 pairs."
    )


def test_seeds_that_do_not_count_are_reported() -> None:
    told = sentences(compare_runs([run(1), run(2)], [run(1)]), "a", "b")
    assert told[-1] == "Not counted: seeds that only one of the two has run (2)."
