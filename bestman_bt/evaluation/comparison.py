"""Pairing of the entries of evaluations for comparison, and the output."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.finished_evaluation import FinishedEntry
from bestman_bt.evaluation.interval import decimals_of
from bestman_bt.evaluation.markdown import table_row
from bestman_bt.evaluation.paired_comparison import (
    FEWEST_PAIRS,
    SIGNIFICANCE,
    MetricComparison,
    PairedComparison,
    SuccessComparison,
    compare_runs,
)

COLUMNS = 4
UP, DOWN, SAME = "#d95f02", "#1b7f8c", "#9a9a9a"
"""Styles of the lines of pairs whose second value is larger, smaller, or equal."""
MAX_NAME = 22


def draw_comparison(path: Path, comparison: PairedComparison, first: str, second: str, title: str = "") -> None:
    """Write a PNG or SVG file, by the suffix of ``path``: a panel for success and one per metric."""
    panels = 1 + len(comparison.metrics)
    rows = math.ceil(panels / COLUMNS)
    columns = min(panels, COLUMNS)
    figure = Figure(figsize=(2.9 * columns, 3.1 * rows + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    names = short_names(first, second)
    _draw_success(axes[0], comparison.success, names)
    for axis, metric in zip(axes[1:], comparison.metrics, strict=False):
        _draw_metric(axis, metric, names)
    for axis in axes[panels:]:
        axis.set_visible(False)
    if title:
        figure.suptitle(title, fontsize=11)
    figure.savefig(path, dpi=130)


def short_names(first: str, second: str) -> list[str]:
    """Return the names with at most ``MAX_NAME`` characters, without their common beginning if they would be equal."""
    shortened = [name if len(name) <= MAX_NAME else f"{name[: MAX_NAME - 1]}…" for name in (first, second)]
    if shortened[0] != shortened[1]:
        return shortened
    differ = (place for place, (a, b) in enumerate(zip(first, second, strict=False)) if a != b)
    shared = next(differ, min(len(first), len(second)))
    ends = [name[min(shared, len(name) - MAX_NAME + 1) :] for name in (first, second)]
    return [f"…{end}" if len(end) < MAX_NAME else f"…{end[: MAX_NAME - 2]}…" for end in ends]


def _draw_success(axis: Any, success: SuccessComparison, names: list[str]) -> None:
    """Draw the numbers of successes as bars; seeds in which only one succeeded are coloured."""
    only = (success.only_first, success.only_second)
    axis.bar((0, 1), [success.both] * 2, width=0.5, color="#c9c9c9")
    axis.bar((0, 1), only, width=0.5, bottom=[success.both] * 2, color=(DOWN, UP))
    for place, own in enumerate(only):
        axis.annotate(f"{success.both + own}", (place, success.both + own), ha="center", va="bottom", fontsize=8)
    axis.set_ylim(0, 1.12 * success.pairs)
    axis.yaxis.set_major_locator(MaxNLocator(integer=True))
    axis.set_ylabel(f"successes of {success.pairs} (grey: of both)", fontsize=8)
    _finish(axis, names, "success", success.p_value)


def _draw_metric(axis: Any, metric: MetricComparison, names: list[str]) -> None:
    for a, b in zip(metric.first, metric.second, strict=True):
        axis.plot((0, 1), (a, b), "-o", color=UP if b > a else DOWN if b < a else SAME, lw=0.8, ms=3, alpha=0.65)
    for place, values in enumerate((metric.first, metric.second)):
        side = 0.16 if place else -0.16
        axis.plot((place + side - 0.07, place + side + 0.07), [float(np.median(values))] * 2, "k-", lw=2)
    _finish(axis, names, metric.name, metric.adjusted_p)


def _finish(axis: Any, names: list[str], title: str, p_value: float) -> None:
    axis.set_xlim(-0.45, 1.45)
    axis.set_xticks((0, 1), names, fontsize=8)
    axis.tick_params(axis="y", labelsize=8)
    weight = "bold" if p_value < SIGNIFICANCE else "normal"
    axis.set_title(f"{title}\n{p_words(p_value)}", fontsize=9, fontweight=weight)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


@dataclass(frozen=True)
class ComparedEntries:
    """An entry and the one that it is compared with, under distinct names."""

    first: FinishedEntry
    second: FinishedEntry
    names: tuple[str, str]

    @cached_property
    def comparison(self) -> PairedComparison:
        """The statistics. Raises ConfigurationError if the two have no seed in common."""
        try:
            return compare_runs(self.first.results, self.second.results)
        except ValueError as error:
            raise ConfigurationError([Problem(" and ".join(self.names), None, "", str(error))]) from error

    def lines(self) -> Iterator[str]:
        """Yield a section of Markdown: the compared entries, and a sentence about success and each metric."""
        yield f"### {self.names[1]} against {self.names[0]}"
        yield ""
        for name, entry in zip(self.names, (self.first, self.second), strict=True):
            settings = ", ".join(f"{key}={value}" for key, value in entry.settings.items()) or "no settings of its own"
            yield f"- {name}: task {entry.task}, {settings}"
        yield ""
        yield from (f"- {sentence}" for sentence in sentences(self.comparison, *self.names))

    def document(self) -> dict[str, Any]:
        """Return the comparison for JSON."""
        sides = [
            {"name": name, "entry": entry.name, "task": entry.task, "settings": dict(entry.settings)}
            for name, entry in zip(self.names, (self.first, self.second), strict=True)
        ]
        told = sentences(self.comparison, *self.names)
        return {"first": sides[0], "second": sides[1], "sentences": told, **asdict(self.comparison)}

    def draw(self, path: Path) -> None:
        """Write the picture."""

        draw_comparison(path, self.comparison, *self.names)


def within(entries: Sequence[FinishedEntry]) -> list[ComparedEntries]:
    """Compare each entry with the first entry of the same task; if all tasks differ, with the first entry."""
    firsts = {entry.task: entry for entry in reversed(entries)}
    compared = [(firsts[entry.task], entry) for entry in entries if entry is not firsts[entry.task]]
    compared = compared or [(entries[0], entry) for entry in entries[1:]]
    return [ComparedEntries(first, second, (first.name, second.name)) for first, second in compared]


def matched(
    firsts: Sequence[FinishedEntry], seconds: Sequence[FinishedEntry], given: tuple[str, str]
) -> list[ComparedEntries]:
    """Return pairs of entries with equal names, or the only two. Raises ConfigurationError if nothing matches."""
    if len(firsts) == len(seconds) == 1:
        return [ComparedEntries(firsts[0], seconds[0], _told_apart(firsts[0].name, seconds[0].name, given))]
    by_name = {entry.name: entry for entry in seconds}
    pairs = [(entry, by_name[entry.name]) for entry in firsts if entry.name in by_name]
    if not pairs:
        names = ", ".join(entry.name for entry in firsts), ", ".join(entry.name for entry in seconds)
        message = f"no entry has the same name as one of {given[1]} ({names[0]}; {names[1]}): name one as FOLDER:ENTRY"
        raise ConfigurationError([Problem(given[0], None, "", message)])
    if len(pairs) == 1:
        ((one, other),) = pairs
        return [ComparedEntries(one, other, _told_apart(one.name, other.name, given))]
    folders = [_told_apart(one.name, other.name, given) for one, other in pairs]
    return [
        ComparedEntries(one, other, (f"{first}:{one.name}", f"{second}:{other.name}"))
        for (one, other), (first, second) in zip(pairs, folders, strict=True)
    ]


def _told_apart(first: str, second: str, given: tuple[str, str]) -> tuple[str, str]:
    """Return names of entries, or of their folders if the names are equal. Raises ConfigurationError if these are
    equal, too.
    """
    if first != second:
        return first, second
    folders = [Path(side.rpartition(":")[0] if side.endswith(f":{first}") else side) for side in given]
    names = [folder.resolve().name for folder in folders]
    if folders[0].resolve() == folders[1].resolve():
        raise ConfigurationError([Problem(given[0], None, "", "is compared with itself: name another one")])
    return (names[0], names[1]) if names[0] != names[1] else (str(folders[0]), str(folders[1]))


def differences_table(compared: Sequence[ComparedEntries]) -> Iterator[str]:
    """Yield a table of Markdown: for each comparison a line with the paired differences, second minus first, and their
    95 % intervals; significant ones are bold.
    """
    names = list(dict.fromkeys(metric.name for one in compared for metric in one.comparison.metrics))
    yield table_row(["", "success, percentage points", *names])
    yield "| --- |" + " --- |" * (1 + len(names))
    for one in compared:
        success, metrics = one.comparison.success, {metric.name: metric for metric in one.comparison.metrics}
        low, high = success.interval
        told = f"{100 * success.difference:+.0f} ({100 * low:+.0f} to {100 * high:+.0f})"
        cells = [_bold(told, success.p_value)]
        for metric in map(metrics.get, names):
            if metric is None:
                cells.append("–")
            else:
                shift, interval = difference_words(metric)
                cells.append(_bold(f"{shift} ({interval})" if interval else shift, metric.adjusted_p))
        yield table_row([f"{one.names[1]} against {one.names[0]}", *cells])


def _bold(text: str, p_value: float) -> str:
    return f"**{text}**" if p_value < SIGNIFICANCE else text


MOST_PAIRS = 1000
"""Larger numbers of pairs are not reported, because they are impractical."""


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
        f"difference {100 * success.difference:+.0f} percentage points (95 % interval {100 * low:+.0f} to "
        f"{100 * high:+.0f}), "
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
    shift, interval = difference_words(metric)
    interval = f"95 % interval {interval}" if interval else f"no interval from fewer than {FEWEST_PAIRS} pairs"
    p_value = p_words(metric.adjusted_p)
    if p_value != p_words(metric.p_value):
        p_value += f" ({p_words(metric.p_value)} without the correction for several metrics)"
    figures = f"{second} − {first} = {shift} ({interval}), {p_value}"
    if metric.adjusted_p < SIGNIFICANCE:
        larger, smaller = (second, first) if metric.shift > 0 else (first, second)
        return f"{metric.name}: larger with {larger} than with {smaller}: {figures}, {_pairs(metric.pairs)}."
    return f"{metric.name}: no difference shown: {figures}{_needed(metric.pairs, metric.pairs_needed)}."


def difference_words(metric: MetricComparison) -> tuple[str, str]:
    """Return a metric's difference and its interval, empty without one, with as many decimals as the interval allows.

    ``("+1.2", "+0.3 to +2.1")``.
    """
    if metric.interval is None:
        return f"{metric.shift:+.{decimals_of(metric.shift, None)}f}", ""
    low, high = metric.interval
    decimals = decimals_of(metric.shift, high - low)
    return f"{metric.shift:+.{decimals}f}", f"{low:+.{decimals}f} to {high:+.{decimals}f}"


def p_words(p_value: float) -> str:
    """Format a p value: ``p = 0.6``, ``p = 0.032``, ``p < 0.0001``."""
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
    """Round an estimate up to the next ten or fifty."""
    step = 1 if count < 20 else 10 if count < 200 else 50
    return -(-count // step) * step
