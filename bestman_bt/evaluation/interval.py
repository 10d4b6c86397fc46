"""Confidence intervals of success rates and medians, and the number of digits that they allow."""

from __future__ import annotations

import math
from collections.abc import Sequence


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return the Wilson score interval of a proportion, 95 %; ``(0, 1)`` without trials."""
    from scipy.stats import binomtest  # takes half a second to import

    if not 0 <= successes <= trials:
        raise ValueError(f"successes should lie between 0 and trials = {trials} but is {successes}")
    if trials == 0:
        return 0.0, 1.0
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)


def median_interval(values: Sequence[float]) -> list[float] | None:
    """Return the 95 % interval of the median by order statistics; None of fewer than six values."""
    count = len(values)
    ordered = sorted(values)
    rank = 0
    if count > 1000:
        rank = int(count / 2 - 0.98 * math.sqrt(count))
    else:
        below = 0.5**count  # the probability that at most ``rank`` values lie below the median
        while below <= 0.025:
            rank += 1
            below += math.comb(count, rank) * 0.5**count
    if rank == 0:
        return None
    return [round(ordered[rank - 1], 3), round(ordered[count - rank], 3)]


def decimals_of(value: float, width: float | None) -> int:
    """Return the number of decimals of a value so that the width of its interval has two significant digits.

    Without an interval, or with a zero width, the value has two.
    """
    size = width or abs(value)
    if not math.isfinite(size) or size == 0:
        return 0
    return min(max(0, 1 - math.floor(math.log10(size))), 4)
