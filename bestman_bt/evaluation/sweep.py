"""A sweep: the entries of a suite, or tasks, with every combination of settings that have several values."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.evaluation.code_version import config_fingerprint
from bestman_bt.evaluation.finished_evaluation import FinishedEntry
from bestman_bt.evaluation.suite import EntryConfig, Suite

COLUMNS = 3
_COMMA = re.compile(r",(?![^\[{]*[\]}])")
"""A comma outside lists and mappings."""


def combinations(settings: Sequence[str], together: bool = False) -> list[tuple[str, ...]]:
    """Return all combinations, the last setting varying fastest: ``["a=1,2", "b=x"]`` → ``[("a=1", "b=x"), ("a=2",
    "b=x")]``.

    ``together``: combine the first values of all settings, then the second ones, and so on. Raises ConfigurationError
    if no setting has several values.
    """
    swept = []
    for setting in settings:
        key, _, values = setting.partition("=")
        swept.append([f"{key}={value.strip()}" for value in _COMMA.split(values)])
    several = [values for values in swept if len(values) > 1]
    if not several:
        raise _problem("no setting has several values: give one as KEY=A,B,C")
    lengths = {len(values) for values in several}
    if together and len(lengths) > 1:
        raise _problem(
            f"--together needs the same number of values for each setting, got {', '.join(map(str, sorted(lengths)))}"
        )
    if together:
        return list(
            zip(*(values if len(values) > 1 else values * lengths.copy().pop() for values in swept), strict=True)
        )
    return list(product(*swept))


def sweep_suite(suite: Callable[[tuple[str, ...]], Suite], settings: Sequence[tuple[str, ...]]) -> Suite:
    """Return one suite with the entries of ``suite(combination)`` for each combination, without controls.

    An entry is named by the differing settings, and its task if there are several. Raises ConfigurationError listing
    every fault, also combinations that are the same run.
    """
    constant = set.intersection(*map(set, settings))
    faults = ProblemCollector()
    entries = []
    made = None
    fingerprints: dict[str, tuple[str, ...]] = {}
    for combination in settings:
        with faults.step():
            made = suite(combination)
            own = tuple(one for one in combination if one not in constant)
            for entry in made.entries:
                if not entry.control:
                    same = fingerprints.setdefault(config_fingerprint(entry.config), combination)
                    if same is not combination:
                        raise _problem(f"{', '.join(same)} and {', '.join(combination)} are the same run")
                    asked = entry.asked or EntryConfig()
                    told = [
                        f"{key.rpartition('.')[2]}={value}" for key, _, value in (one.partition("=") for one in own)
                    ]
                    name = ", ".join(told if len(made.entries) == 1 else (entry.name, *told))
                    entries.append(replace(entry, name=name, asked=replace(asked, settings=(*asked.settings, *own))))
    faults.raise_if_any()
    assert made is not None
    return replace(made, name=f"{made.name}_sweep", entries=tuple(entries))


def draw_settings(path: Path, entries: Sequence[FinishedEntry]) -> None:
    """Write an SVG or PNG: success and each metric over the entries, a thin line per seed, a thick one of medians."""
    metrics: dict[str, None] = {}
    for entry in entries:
        for result in entry.results:
            metrics |= dict.fromkeys([*result.metrics, *result.durations])
    rows = -(-(1 + len(metrics)) // COLUMNS)
    names = [", ".join(f"{key.rpartition('.')[2]}={value}" for key, value in one.settings.items()) for one in entries]
    figure = Figure(figsize=(3.6 * COLUMNS, 2.6 * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(rows, COLUMNS)).ravel()
    places = range(len(entries))
    axes[0].bar(places, [np.mean([float(one.success) for one in entry.results] or [np.nan]) for entry in entries])
    axes[0].set_ylim(0, 1.05)
    for axis, metric in zip(axes[1:], metrics, strict=False):
        measured = [
            {result.seed: {**result.metrics, **result.durations}.get(metric, np.nan) for result in entry.results}
            for entry in entries
        ]
        for seed in sorted(set().union(*measured)):
            axis.plot(places, [values.get(seed, np.nan) for values in measured], "-", color="#9a9a9a", lw=0.7)
        medians = [_median(list(values.values())) for values in measured]
        axis.plot(places, medians, "-o", color="black", lw=2, ms=4)
    for axis, title in zip(axes, ("success", *metrics), strict=False):
        axis.set_title(title, fontsize=9)
        axis.set_xticks(list(places), names, fontsize=7, rotation=20, ha="right")
        axis.tick_params(axis="y", labelsize=8)
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
    for axis in axes[1 + len(metrics) :]:
        axis.set_visible(False)
    figure.savefig(path, dpi=130)


def _median(values: Sequence[float]) -> float:
    finite = [value for value in values if np.isfinite(value)]
    return float(np.median(finite)) if finite else float("nan")


def _problem(message: str) -> ConfigurationError:
    return ConfigurationError([Problem("--set", None, "", message)])
