"""Confidence intervals of success rates and medians: the significant digits, the required number of episodes."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bestman_bt.configuration.errors import ConfigurationError, Problem


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return the Wilson score interval of a proportion, 95 %; ``(0, 1)`` without trials."""
    from scipy.stats import binomtest  # takes half a second to import

    if not 0 <= successes <= trials:
        raise ValueError(f"successes should lie between 0 and trials = {trials} but is {successes}")
    if trials == 0:
        return 0.0, 1.0
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)


def median_interval(values: ArrayLike) -> list[float] | None:
    """Return the 95 % interval of the median of ``values`` (N,) by order statistics; None with fewer than six."""
    ordered = np.sort(values)
    count = len(ordered)
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
    return [round(float(ordered[rank - 1]), 3), round(float(ordered[count - rank]), 3)]


def decimals_of(value: float, width: float | None) -> int:
    """Return the number of decimals of a value so that the width of its interval has two significant digits.

    Without an interval, or with a zero width, the value has two.
    """
    size = width or abs(value)
    if not math.isfinite(size) or size == 0:
        return 0
    return min(max(0, 1 - math.floor(math.log10(size))), 4)


_TEXT = re.compile(r"95\s*%?\s*(?:±|\+-|\+/-)\s*(\d+(?:\.\d+)?)\s*%?")
_Z = 1.959964
_GROWTH = 50
"""Larger numbers are searched in steps of this fraction."""


@dataclass(frozen=True)
class Precision:
    """``95%±3``: the 95 % interval (Wilson) of a success rate is at most 3 percentage points wide to either side."""

    half_width: float

    @classmethod
    def parse(cls, text: str) -> Precision:
        """Parse a precision such as ``95%±3``. Raises ConfigurationError for other text."""
        match = _TEXT.fullmatch(text.strip())
        points = float(match[1]) if match else 0.0
        if not 0.5 <= points <= 50:
            why = f"should be 95%±N with N from 0.5 to 50 percentage points, such as 95%±3, got '{text}'"
            raise ConfigurationError([Problem("--until", None, "", why)])
        return cls(points / 100)

    def __str__(self) -> str:
        return f"95%±{100 * self.half_width:g}"

    def episodes(self, successes: Sequence[bool], most: int) -> int:
        """Return the total number of episodes to run, at most ``most``; the number of ``successes`` if they suffice.

        Episodes run in rounds: the first has the number that suffices if all succeed, each further one the number that
        suffices at the rate so far. The number depends only on the results in the order of their seeds, not on the
        order of execution.
        """
        done = 0
        while done < most:
            wanted = min(self.enough(sum(successes[:done]), done), most)
            if wanted <= done or wanted > len(successes):
                return wanted
            done = wanted
        return most

    def enough(self, successes: int, trials: int) -> int:
        """Return the number of trials after which the interval is narrow enough, at the same success rate."""
        rate = successes / trials if trials else 1.0
        enough = max(trials, 1)
        while _half_width(rate, enough) > self.half_width:
            enough += max(1, enough // _GROWTH)
        return enough


def _half_width(rate: float, trials: int) -> float:
    """Return half the width of Wilson's 95 % interval."""
    return _Z * math.sqrt(rate * (1 - rate) / trials + (_Z / (2 * trials)) ** 2) / (1 + _Z**2 / trials)
