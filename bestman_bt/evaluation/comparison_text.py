"""A comparison in words: one sentence about success and one about each metric."""

from __future__ import annotations

from bestman_bt.evaluation.interval import decimals_of
from bestman_bt.evaluation.paired_comparison import (
    FEWEST_PAIRS,
    SIGNIFICANCE,
    MetricComparison,
    PairedComparison,
    SuccessComparison,
)

MOST_PAIRS = 1000
"""Larger numbers of pairs are not reported: no one runs so many."""


def sentences(comparison: PairedComparison, first: str, second: str) -> list[str]:
    """Return sentences about success, each metric, and excluded runs. ``first``, ``second``: names of the two."""
    told = [success_sentence(comparison.success, first, second)]
    told += [metric_sentence(metric, first, second) for metric in comparison.metrics]
    if comparison.unpaired:
        seeds = ", ".join(str(seed) for seed in comparison.unpaired[:10])
        more = " …" if len(comparison.unpaired) > 10 else ""
        told.append(f"Not counted: seeds that only one of the two has run ({seeds}{more}).")
    return told


def success_sentence(success: SuccessComparison, first: str, second: str) -> str:
    """Return which of the two succeeds more often, or that this is not shown."""
    firsts, seconds = success.both + success.only_first, success.both + success.only_second
    low, high = success.interval
    figures = (
        f"{first} {firsts} of {success.pairs}, {second} {seconds} of {success.pairs}, "
        f"difference {100 * success.difference:+.0f} % (95 % interval {100 * low:+.0f} to {100 * high:+.0f} %), "
        f"McNemar's test {p_words(success.p_value)}"
    )
    if success.p_value < SIGNIFICANCE:
        better, worse = (second, first) if success.difference > 0 else (first, second)
        return f"success: higher with {better} than with {worse}: {figures}, {_pairs(success.pairs)}."
    return f"success: no difference shown: {figures}{_needed(success.pairs, success.pairs_needed)}."


def metric_sentence(metric: MetricComparison, first: str, second: str) -> str:
    """Return which of the two has the larger values, or that this is not shown."""
    if metric.first == metric.second:
        return f"{metric.name}: the same in {'each of the ' if metric.pairs > 1 else ''}{_pairs(metric.pairs)}."
    width = None if metric.interval is None else metric.interval[1] - metric.interval[0]
    decimals = decimals_of(metric.shift, width)
    if metric.interval is None:
        interval = f"no interval from fewer than {FEWEST_PAIRS} pairs"
    else:
        low, high = (f"{bound:+.{decimals}f}" for bound in metric.interval)
        interval = f"95 % interval {low} to {high}"
    p_value = p_words(metric.adjusted_p)
    if p_value != p_words(metric.p_value):
        p_value += f" ({p_words(metric.p_value)} without the correction for several metrics)"
    figures = f"{second} − {first} = {metric.shift:+.{decimals}f} ({interval}), {p_value}"
    if metric.adjusted_p < SIGNIFICANCE:
        larger, smaller = (second, first) if metric.shift > 0 else (first, second)
        return f"{metric.name}: larger with {larger} than with {smaller}: {figures}, {_pairs(metric.pairs)}."
    return f"{metric.name}: no difference shown: {figures}{_needed(metric.pairs, metric.pairs_needed)}."


def p_words(p_value: float) -> str:
    """``p = 0.6``, ``p = 0.032``, ``p < 0.0001``."""
    if p_value < 0.0001:
        return "p < 0.0001"
    return f"p = {p_value:.1g}" if p_value >= 0.1 else f"p = {p_value:.2g}"


def _needed(pairs: int, needed: int | None) -> str:
    told = f", {_pairs(pairs)}"
    if needed is not None and needed > MOST_PAIRS:
        told += f"; a difference this small takes more than {MOST_PAIRS}"
    elif needed is not None and needed > pairs:
        told += f"; about {_rounded(needed - pairs)} more would decide"
    return told


def _pairs(count: int) -> str:
    return f"{count} pair" if count == 1 else f"{count} pairs"


def _rounded(count: int) -> int:
    """Up to the next ten, or fifty: it is an estimate."""
    step = 1 if count < 20 else 10 if count < 200 else 50
    return -(-count // step) * step
