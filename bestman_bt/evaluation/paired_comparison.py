"""Two sets of runs of the same seeds compared: success by McNemar's test, metrics by Wilcoxon's signed-rank test."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import binomtest, norm, wilcoxon

from bestman_bt.evaluation.result import Outcome, RunResult

SIGNIFICANCE = 0.05
"""The p value below which a difference counts as significant; intervals are 95 %."""
POWER = 0.8
"""The probability with which the proposed number of pairs shows a difference of the observed size."""
FEWEST_PAIRS = 6
"""Smallest number of pairs with which a test can reach p < 5 %."""

_Z = float(norm.ppf(1 - SIGNIFICANCE / 2))
_Z_POWER = float(norm.ppf(POWER))
_EXACT_UP_TO = 100
"""Differences up to which the null distribution of the signed ranks is computed exactly instead of approximated."""


@dataclass(frozen=True)
class SuccessComparison:
    """Paired comparison of success: numbers of pairs with both, one or no success.

    ``difference``: success rate of the second minus that of the first, with its ``interval`` (95 %, Tango's score
    interval). ``p_value``: McNemar's exact test. ``pairs_needed``: number of pairs that shows a difference of this size
    with 80 % probability, or None without a difference.
    """

    both: int
    only_first: int
    only_second: int
    neither: int
    difference: float
    interval: tuple[float, float]
    p_value: float
    pairs_needed: int | None

    @property
    def pairs(self) -> int:
        """Number of seeds that both sides have run."""
        return self.both + self.only_first + self.only_second + self.neither


@dataclass(frozen=True)
class MetricComparison:
    """Paired comparison of one metric over the seeds for which both runs succeeded and measured it.

    ``first``, ``second``: values in the order of ``seeds``. ``shift``: second minus first, Hodges-Lehmann estimate;
    ``interval``: its 95 % interval, None with fewer than six pairs. ``p_value``: signed-rank test; ``adjusted_p``:
    Holm's correction for the number of metrics. ``pairs_needed``: as for ``SuccessComparison``.
    """

    name: str
    seeds: tuple[int, ...]
    first: tuple[float, ...]
    second: tuple[float, ...]
    shift: float
    interval: tuple[float, float] | None
    p_value: float
    adjusted_p: float
    pairs_needed: int | None

    @property
    def pairs(self) -> int:
        """Number of seeds for which both runs succeeded and measured the metric."""
        return len(self.seeds)


@dataclass(frozen=True)
class PairedComparison:
    """Comparison of two sets of runs; ``unpaired``: seeds of only one side, which are excluded."""

    success: SuccessComparison
    metrics: tuple[MetricComparison, ...]
    unpaired: tuple[int, ...]


def compare_runs(first: Sequence[RunResult], second: Sequence[RunResult]) -> PairedComparison:
    """Compare runs of the same seeds; cancelled runs do not count. Raises ValueError without a common seed."""
    firsts, seconds = ({r.seed: r for r in side if r.outcome is not Outcome.CANCELLED} for side in (first, second))
    seeds = sorted(firsts.keys() & seconds.keys())
    if not seeds:
        raise ValueError("no seed is in both: runs are compared pair by pair, and need the same first seed")
    pairs = [(firsts[seed], seconds[seed]) for seed in seeds]
    return PairedComparison(
        compare_successes([(a.success, b.success) for a, b in pairs]),
        _compare_metrics([(a, b) for a, b in pairs if a.success and b.success]),
        tuple(sorted(firsts.keys() ^ seconds.keys())),
    )


def compare_successes(pairs: Sequence[tuple[bool, bool]]) -> SuccessComparison:
    """Apply McNemar's exact test, a binomial test of the pairs that differ. Raises ValueError without pairs."""
    if not pairs:
        raise ValueError("pairs should hold at least one pair")
    counted = {
        outcome: list(pairs).count(outcome) for outcome in ((a, b) for a in (True, False) for b in (True, False))
    }
    only_first, only_second = counted[True, False], counted[False, True]
    differing = only_first + only_second
    return SuccessComparison(
        both=counted[True, True],
        only_first=only_first,
        only_second=only_second,
        neither=counted[False, False],
        difference=(only_second - only_first) / len(pairs),
        interval=tango_interval(only_first, only_second, len(pairs)),
        p_value=float(binomtest(only_first, differing).pvalue) if differing else 1.0,
        pairs_needed=_pairs_for_mcnemar(only_first / len(pairs), only_second / len(pairs)),
    )


def tango_interval(only_first: int, only_second: int, pairs: int) -> tuple[float, float]:
    """Return the 95 % score interval of the difference of two paired proportions, second minus first.

    T. Tango, Equivalence test and confidence interval for the difference in proportions for the paired-sample design,
    Statistics in Medicine 17, 1998.
    """

    def score(difference: float) -> float:
        linear = -only_second - only_first + (2 * pairs - only_second + only_first) * difference
        constant = -only_first * difference * (1 - difference)
        restricted = (math.sqrt(linear**2 - 8 * pairs * constant) - linear) / (4 * pairs)
        variance = pairs * (2 * restricted + difference * (1 - difference))
        return (only_second - only_first - pairs * difference) / math.sqrt(max(variance, 1e-300))

    return _root(lambda difference: score(difference) - _Z, -1.0), _root(lambda difference: score(difference) + _Z, 1.0)


def _root(function: Callable[[float], float], otherwise: float) -> float:
    """Return the root of a function in (-1, 1), or ``otherwise`` if it does not change its sign."""
    low, high = -1 + 1e-9, 1 - 1e-9
    if function(low) * function(high) > 0:
        return otherwise
    return float(brentq(function, low, high))


def _pairs_for_mcnemar(only_first: float, only_second: float) -> int | None:
    """Return the number of pairs for McNemar's test: R. J. Connor, Sample size for testing differences in proportions
    for the paired-sample design, 1987.
    """
    difference, differing = only_second - only_first, only_second + only_first
    if difference == 0:
        return None
    spread = _Z * math.sqrt(differing) + _Z_POWER * math.sqrt(differing - difference**2)
    return math.ceil(max((spread / difference) ** 2, FEWEST_PAIRS / differing))


def compare_values(
    name: str, seeds: Sequence[int], first: Sequence[float], second: Sequence[float]
) -> MetricComparison:
    """Compare paired values of one metric: Wilcoxon's signed-rank test, Hodges-Lehmann estimate and interval.

    Raises ValueError without pairs.
    """
    if not seeds or not len(seeds) == len(first) == len(second):
        raise ValueError(f"{name} should have one value for each seed, and at least one")
    differences = np.asarray(second, dtype=np.float64) - np.asarray(first, dtype=np.float64)
    p_value = float(wilcoxon(differences).pvalue) if np.any(differences) else 1.0
    shift, interval = hodges_lehmann(differences)
    needed = _pairs_for_signed_ranks(differences)
    return MetricComparison(name, tuple(seeds), tuple(first), tuple(second), shift, interval, p_value, p_value, needed)


def hodges_lehmann(differences: NDArray[np.float64]) -> tuple[float, tuple[float, float] | None]:
    """Return the median of all means of two of the (n,) differences, and its 95 % interval, None with fewer than six.

    M. Hollander, D. A. Wolfe, Nonparametric Statistical Methods, section 3.
    """
    count = len(differences)
    rows, columns = np.triu_indices(count)
    means = np.sort((differences[rows] + differences[columns]) / 2)
    shift = float(np.median(means))
    if count < FEWEST_PAIRS:
        return shift, None
    rank = max(_lower_rank_sum(count), 1)
    return shift, (float(means[rank - 1]), float(means[len(means) - rank]))


def _lower_rank_sum(count: int) -> int:
    """Return the smallest sum of signed ranks that is, by chance, not exceeded with at least 2.5 %."""
    if count > _EXACT_UP_TO:
        return int(count * (count + 1) / 4 - _Z * math.sqrt(count * (count + 1) * (2 * count + 1) / 24))
    chances = np.ones(1)
    for rank in range(1, count + 1):
        wider = np.zeros(len(chances) + rank)
        wider[: len(chances)] += chances / 2
        wider[rank:] += chances / 2
        chances = wider
    return int(np.searchsorted(np.cumsum(chances), SIGNIFICANCE / 2))


def _pairs_for_signed_ranks(differences: NDArray[np.float64]) -> int | None:
    """Return the number of pairs for signed ranks: that of the paired t-test, by their efficiency 3 / pi."""
    mean = float(np.mean(differences))
    if len(differences) < 2 or mean == 0:
        return None
    spread = float(np.std(differences, ddof=1))
    return max(math.ceil(((_Z + _Z_POWER) * spread / mean) ** 2 * math.pi / 3), FEWEST_PAIRS)


def _compare_metrics(pairs: Sequence[tuple[RunResult, RunResult]]) -> tuple[MetricComparison, ...]:
    measured = [(a.seed, all_metrics(a), all_metrics(b)) for a, b in pairs]
    found = []
    for name in dict.fromkeys(name for _, ours, _ in measured for name in ours):
        values = [
            (seed, ours[name], theirs[name]) for seed, ours, theirs in measured if name in ours and name in theirs
        ]
        if values:
            found.append(compare_values(name, *zip(*values, strict=True)))
    return _adjusted(found)


def all_metrics(result: RunResult) -> dict[str, float]:
    """Return the judge's metrics, the durations by kind of work, and the simulated time of the run, seconds."""
    measured = {**result.metrics, **result.durations, "time_s": result.sim_time_s}
    return {name: value for name, value in measured.items() if math.isfinite(value)}


def _adjusted(metrics: Sequence[MetricComparison]) -> tuple[MetricComparison, ...]:
    """Adjust p values for their number: S. Holm, A simple sequentially rejective test procedure, 1979."""
    adjusted: dict[str, float] = {}
    least = 0.0
    for position, metric in enumerate(sorted(metrics, key=lambda metric: metric.p_value)):
        least = max(least, min(1.0, metric.p_value * (len(metrics) - position)))
        adjusted[metric.name] = least
    return tuple(replace(metric, adjusted_p=adjusted[metric.name]) for metric in metrics)
