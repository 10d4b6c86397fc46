"""Summary of many judged runs of one task as a flat document."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.interval import decimals_of, median_interval, wilson_interval
from bestman_bt.evaluation.result import Outcome, RunResult


def summarize(task: str, first_seed: int, results: Sequence[RunResult], wall_time_s: float) -> dict[str, Any]:
    """Return the document printed by ``eval --json``; ``results`` in the order of their seeds.

    ``errors``: runs that raised an error. ``false_successes``: runs whose tree succeeded although the predicate does
    not hold. ``unearned``: successes not due to the robot, with the reason; they count in ``succeeded``.
    ``audit_clean``: no cheat in any run; a run without an audit is not clean. ``interval``: Wilson, 95 %. ``metrics``:
    median, its 95 % interval and 95th percentile over the runs that have the metric; ``accuracy`` and ``durations``:
    over those whose tree succeeded. ``causes``: error code → number of failures, the most frequent first. ``slowest``:
    in simulated time.
    """
    succeeded = sum(result.success for result in results)
    sim_time = sum(result.sim_time_s for result in results)
    busy = sum(result.wall_time_s for result in results)
    failures = [_failure(result) for result in results if not result.success]
    unclean = [r.seed for r in results if any(r.audit.get(cheat) != 0 for cheat in CHEATS)]
    succeeded_trees = [result for result in results if result.tree_status == "SUCCESS"]
    slowest = max(results, key=lambda result: result.sim_time_s, default=None)
    return {
        "task": task,
        "episodes": len(results),
        "first_seed": first_seed,
        "succeeded": succeeded,
        "success_rate": round(succeeded / len(results), 4) if results else 0.0,
        "interval": [round(bound, 4) for bound in wilson_interval(succeeded, len(results))],
        "audit_clean": not unclean,
        "unclean_seeds": unclean,
        "errors": sum(result.outcome is Outcome.ERROR for result in results),
        "false_successes": sum(r.tree_status == "SUCCESS" and r.predicate is False for r in results),
        "unearned": [{"seed": result.seed, "why": result.unearned} for result in results if result.unearned],
        "failures": failures,
        "causes": dict(Counter(failure["error_code"] for failure in failures).most_common()),
        "slowest": {"seed": slowest.seed, "sim_time_s": slowest.sim_time_s} if slowest else None,
        "sim_time_s": round(sim_time, 3),
        "wall_time_s": round(wall_time_s, 3),
        "real_time_factor": round(sim_time / busy, 3) if busy > 0 else 0.0,
        "metrics": spreads([result.metrics for result in results]),
        "accuracy": spreads([result.metrics for result in succeeded_trees]),
        "durations": spreads([{**result.durations, "time_s": result.sim_time_s} for result in succeeded_trees]),
    }


def spreads(measurements: Sequence[Mapping[str, float]]) -> dict[str, dict[str, Any]]:
    """Return metric → median, its 95 % interval, and the 95th percentile, over the runs that measured it."""
    measured: dict[str, list[float]] = {}
    for metrics in measurements:
        for name, value in metrics.items():
            if math.isfinite(value):
                measured.setdefault(name, []).append(value)
    return {
        name: {
            "median": round(float(np.median(values)), 3),
            "interval": median_interval(values),
            "p95": round(float(np.percentile(values, 95)), 3),
        }
        for name, values in sorted(measured.items())
    }


def spread_words(spread: Mapping[str, Any]) -> str:
    """Return median and 95th percentile, such as ``3.1 / 7.9``, rounded as the interval of the median allows."""
    median, p95, interval = spread["median"], spread["p95"], spread.get("interval")
    decimals = decimals_of(median, None if interval is None else interval[1] - interval[0])
    return f"{median:.{decimals}f} / {p95:.{decimals}f}"


def _failure(result: RunResult) -> dict[str, Any]:
    failure = result.failure
    return {
        "seed": result.seed,
        "node": failure.named if failure else "",
        "error_code": failure.error_code if failure else str(result.outcome),
        "why": failure.why if failure else "the run was not judged a success",
    }
