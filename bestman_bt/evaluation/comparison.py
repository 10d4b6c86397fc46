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
from bestman_bt.evaluation.comparison_text import p_words, sentences
from bestman_bt.evaluation.finished_evaluation import FinishedEntry
from bestman_bt.evaluation.paired_comparison import (
    SIGNIFICANCE,
    MetricComparison,
    PairedComparison,
    SuccessComparison,
    compare_runs,
)

# A comparison as a picture: success, and for each metric the values of both runs of each pair, joined by a line.


COLUMNS = 4
UP, DOWN, SAME = "#d95f02", "#1b7f8c", "#9a9a9a"
"""Lines of pairs of which the second value is larger, smaller, or equal."""
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
    """Bars of the rates, each with what only it succeeded in drawn apart."""
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
    """Return each entry with the first one of its task; if all tasks differ, with the first of all."""
    firsts = {entry.task: entry for entry in reversed(entries)}
    compared = [(firsts[entry.task], entry) for entry in entries if entry is not firsts[entry.task]]
    compared = compared or [(entries[0], entry) for entry in entries[1:]]
    return [ComparedEntries(first, second, (first.name, second.name)) for first, second in compared]


def matched(
    firsts: Sequence[FinishedEntry], seconds: Sequence[FinishedEntry], given: tuple[str, str]
) -> list[ComparedEntries]:
    """Return the entries of one name, or the only two. Raises ConfigurationError if nothing matches."""
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
    """Names of entries, or of the folders where those are the same. Raises ConfigurationError if these are, too."""
    if first != second:
        return first, second
    folders = [Path(side.rpartition(":")[0] if side.endswith(f":{first}") else side) for side in given]
    names = [folder.resolve().name for folder in folders]
    if folders[0].resolve() == folders[1].resolve():
        raise ConfigurationError([Problem(given[0], None, "", "is compared with itself: name another one")])
    return (names[0], names[1]) if names[0] != names[1] else (str(folders[0]), str(folders[1]))
