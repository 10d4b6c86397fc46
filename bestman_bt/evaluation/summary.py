"""Summary of many judged runs of one task as a flat document."""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.interval import decimals_of, median_interval, wilson_interval
from bestman_bt.evaluation.result import Outcome, RunResult


class Summary:
    """Accumulates the results of one task, in any order; keeps numbers, not the results."""

    def __init__(self) -> None:
        self.episodes = 0
        """Number of results added."""
        self._failures: list[dict[str, Any]] = []
        self._unclean: list[int] = []
        self._unearned: list[dict[str, Any]] = []
        self._errors = self._false_successes = 0
        self._slowest = (-math.inf, 0)
        self._sim_time, self._wall_time = array("d"), array("d")
        self._accuracy, self._durations = _Measurements(), _Measurements()
        self._of_failures = _Measurements()
        """The metrics of the runs whose tree did not succeed."""

    def add(self, result: RunResult) -> None:
        """Count a result."""
        self.episodes += 1
        if not result.success:
            self._failures.append(_failure(result))
        if any(result.audit.get(cheat) != 0 for cheat in CHEATS):
            self._unclean.append(result.seed)
        if unearned := result.unearned:
            self._unearned.append({"seed": result.seed, "why": unearned})
        self._errors += result.outcome is Outcome.ERROR
        self._false_successes += result.tree_status == "SUCCESS" and result.predicate is False
        self._slowest = max(self._slowest, (result.sim_time_s, -result.seed))
        self._sim_time.append(result.sim_time_s)
        self._wall_time.append(result.wall_time_s)
        if result.tree_status == "SUCCESS":
            self._accuracy.add(result.metrics)
            self._durations.add({**result.durations, "time_s": result.sim_time_s})
        else:
            self._of_failures.add(result.metrics)

    @property
    def failed_seeds(self) -> set[int]:
        """The seeds of the runs without success."""
        return {_seed(failure) for failure in self._failures}

    def document(self, task: str, first_seed: int, wall_time_s: float | None = None) -> dict[str, Any]:
        """Return the document printed by ``eval --json``.

        ``errors``: runs that raised an error. ``false_successes``: runs whose tree succeeded although the predicate
        does not hold. ``unearned``: successes not due to the robot, with the reason; they count in ``succeeded``.
        ``audit_clean``: no violation of honest simulation in any run; a run without an audit is not clean.
        ``interval``: Wilson, 95 %. ``metrics``: median, its 95 % interval and 95th percentile over the runs that have
        the metric; ``accuracy`` and ``durations``: over those whose tree succeeded. ``causes``: error code → number of
        failures, the most frequent first. ``slowest``: in simulated time. ``wall_time_s``: by default the sum over all
        runs.
        """
        count, failures = self.episodes, sorted(self._failures, key=_seed)
        succeeded = count - len(failures)
        sim_time, busy = math.fsum(self._sim_time), math.fsum(self._wall_time)
        slowest = {"seed": -self._slowest[1], "sim_time_s": self._slowest[0]}
        return {
            "task": task,
            "episodes": count,
            "first_seed": first_seed,
            "succeeded": succeeded,
            "success_rate": round(succeeded / count, 4) if count else 0.0,
            "interval": [round(bound, 4) for bound in wilson_interval(succeeded, count)],
            "audit_clean": not self._unclean,
            "unclean_seeds": sorted(self._unclean),
            "errors": self._errors,
            "false_successes": self._false_successes,
            "unearned": sorted(self._unearned, key=_seed),
            "failures": failures,
            "causes": dict(Counter(failure["error_code"] for failure in failures).most_common()),
            "slowest": slowest if count else None,
            "sim_time_s": round(sim_time, 3),
            "wall_time_s": round(busy if wall_time_s is None else wall_time_s, 3),
            "real_time_factor": round(sim_time / busy, 3) if busy > 0 else 0.0,
            "metrics": _spreads(self._accuracy, self._of_failures),
            "accuracy": _spreads(self._accuracy),
            "durations": _spreads(self._durations),
        }


def summarize(task: str, first_seed: int, results: Iterable[RunResult], wall_time_s: float) -> dict[str, Any]:
    """Return the document of ``results``, see ``Summary.document``."""
    summary = Summary()
    for result in results:
        summary.add(result)
    return summary.document(task, first_seed, wall_time_s)


class _Measurements:
    """Metric → the finite values of the runs that measured it."""

    def __init__(self) -> None:
        self.values: dict[str, array[float]] = {}

    def add(self, metrics: Mapping[str, float]) -> None:
        for name, value in metrics.items():
            if math.isfinite(value):
                self.values.setdefault(name, array("d")).append(value)


def _spreads(*measured: _Measurements) -> dict[str, dict[str, Any]]:
    """Return metric → median, its 95 % interval, and the 95th percentile."""
    spreads: dict[str, dict[str, Any]] = {}
    for name in sorted({name for one in measured for name in one.values}):
        values = np.sort(np.concatenate([one.values[name] for one in measured if name in one.values]))
        spreads[name] = {
            "median": round(float(np.median(values)), 3),
            "interval": median_interval(values),
            "p95": round(float(np.percentile(values, 95)), 3),
        }
    return spreads


def spread_words(spread: Mapping[str, Any]) -> str:
    """Return median and 95th percentile, such as ``3.1 / 7.9``, rounded as the interval of the median allows."""
    median, p95, interval = spread["median"], spread["p95"], spread.get("interval")
    decimals = decimals_of(median, None if interval is None else interval[1] - interval[0])
    return f"{median:.{decimals}f} / {p95:.{decimals}f}"


def _seed(document: Mapping[str, Any]) -> int:
    seed: int = document["seed"]
    return seed


def _failure(result: RunResult) -> dict[str, Any]:
    failure = result.failure
    return {
        "seed": result.seed,
        "node": failure.named if failure else "",
        "error_code": failure.error_code if failure else str(result.outcome),
        "why": failure.why if failure else "the run was not judged a success",
    }
