"""The HTML page of a report: one self-contained file; all content of runs is escaped."""

from __future__ import annotations

import base64
import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.report.run_reader import ReportPicture, RunReport, setting_words
from bestman_bt.evaluation.summary import summarize
from bestman_bt.records.events import DescribedNode
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import HALTED, LOOKS, css_variables
from bestman_bt.records.states import NO
from bestman_bt.records.timeline import Activities, WorkOfNode, work_of_nodes

MAX_SLOW_NODES = 20
MAX_DIFFERENCES = 6
"""Settings that are part of a group's name."""


@dataclass(frozen=True)
class TaskGroup:
    """Runs that are counted together; ``summary``: of the completed ones, from ``summarize``.

    ``others``: outcome → number of runs that did not complete.
    """

    name: str
    summary: dict[str, Any]
    others: dict[str, int]


@dataclass(frozen=True)
class Cause:
    """An error code: the number of runs it ended, with an example: folder, node and message."""

    task: str
    code: str
    count: int
    node: str
    why: str
    seeds: tuple[int, ...]


@dataclass(frozen=True)
class SlowNode:
    """A leaf over all runs of a task: ``median`` and ``p95`` seconds of a run, ``share`` of the runs' time."""

    task: str
    where: str
    path: str
    type: str
    runs: int
    times: int
    failures: int
    median: float
    p95: float
    share: float


def groups_by_name(stories: Sequence[RunReport]) -> dict[str, list[RunReport]]:
    """Return the groups of runs of the same task, entry, robot and settings, in the order of their first run.

    The names contain entry or task, robot, scene and robot settings, and further settings that distinguish groups.
    """
    alike: dict[tuple[Any, ...], list[RunReport]] = defaultdict(list)
    for story in stories:
        alike[story.task, story.robot, story.entry, frozenset(story.settings.items())].append(story)
    same_task: dict[tuple[str, str], list[RunReport]] = defaultdict(list)
    for (task, robot, *_), mine in alike.items():
        same_task[task, robot].append(mine[0])
    named: dict[str, list[RunReport]] = {}
    for (task, robot, *_), mine in alike.items():
        name = base = _name(mine[0], _differing(same_task[task, robot]))
        number = 1
        while name in named:  # what differs is too long to be told
            number += 1
            name = f"{base} ({number})"
        named[name] = mine
    return named


def _differing(stories: Sequence[RunReport]) -> list[str]:
    """Return the settings that are not the same in all of them."""
    keys = dict.fromkeys(key for story in stories for key in story.settings)
    return [key for key in keys if len({story.settings.get(key) for story in stories}) > 1]


def _name(story: RunReport, differing: Sequence[str]) -> str:
    others = [key for key in differing if key in story.settings and not key.startswith(("scene.", "robot."))]
    told = setting_words(story.settings, others[:MAX_DIFFERENCES])
    if len(others) > MAX_DIFFERENCES:
        told += f" and {len(others) - MAX_DIFFERENCES} more"
    parts = (story.entry or story.task, story.robot, story.scene_and_robot_settings, told)
    return " · ".join(part for part in parts if part)


def task_groups(stories: Sequence[RunReport]) -> list[TaskGroup]:
    """Return the groups of ``groups_by_name``, summarised."""
    groups = []
    for name, mine in groups_by_name(stories).items():
        results = [s.result for s in sorted(mine, key=lambda s: s.seed) if s.is_counted and s.result is not None]
        summary = summarize(name, results[0].seed if results else 0, results, sum(r.wall_time_s for r in results))
        groups.append(TaskGroup(name, summary, dict(Counter(s.outcome for s in mine if not s.is_counted))))
    return groups


def causes(stories: Sequence[RunReport]) -> list[Cause]:
    """Return the causes of failed runs, the most frequent first."""
    found: dict[tuple[str, str], list[RunReport]] = defaultdict(list)
    for name, group in groups_by_name(stories).items():
        for story in group:
            if story.is_counted and story.result is not None and not story.result.success:
                code = story.result.failure.error_code if story.result.failure else story.outcome
                found[name, code].append(story)
    told = []
    for (task, code), mine in found.items():
        example = mine[0].result.failure if mine[0].result is not None else None
        node, why = (example.named, example.why) if example is not None else ("", "")
        told.append(Cause(task, code, len(mine), node, why, tuple(sorted(s.seed for s in mine))))
    return sorted(told, key=lambda cause: -cause.count)


def slow_nodes(stories: Sequence[RunReport]) -> list[SlowNode]:
    """Return the leaves that took the most time, over all runs that have a log."""
    found = []
    for task, mine in groups_by_name(stories).items():
        total = sum(story.duration for story in mine if len(story.activities))
        seconds: dict[tuple[str, str, str], list[float]] = defaultdict(list)
        counts: Counter[tuple[str, str, str]] = Counter()
        failures: Counter[tuple[str, str, str]] = Counter()
        for story in mine:
            above = {node.parent for node in story.nodes}  # a leaf that ticks a tree stands above that tree's nodes
            leaves = {node.uid: node for node in story.nodes if node.is_leaf and node.uid not in above}
            in_run: dict[tuple[str, str, str], float] = defaultdict(float)
            for key, work in work_of_nodes(story.activities).items():
                if key in leaves:
                    which = (leaves[key].where, leaves[key].path, leaves[key].type)
                    in_run[which] += work.seconds
                    counts[which] += work.count
                    failures[which] += work.failures
            for which, value in in_run.items():
                seconds[which].append(value)
        for which, values in seconds.items():
            median, p95 = float(np.median(values)), float(np.percentile(values, 95))
            share = sum(values) / total if total > 0 else 0.0
            found.append(SlowNode(task, *which, len(values), counts[which], failures[which], median, p95, share))
    return sorted(found, key=lambda node: -node.share)[:MAX_SLOW_NODES]


_LOOKS = {**LOOKS, IDLE: HALTED}
WIDTH = 1000.0
"""Units of the picture for the whole run; the rows are 22 high."""
LEAST_WIDTH = 2.0
MARK_WIDTH = 14.0
"""Smallest width of a bar that includes its mark."""
MAX_ROWS = 150
MAX_BARS = 6000
_TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
_BY_WEIGHT = np.array([SKIPPED, SUCCESS, NO, IDLE, RUNNING, FAILURE])
"""Results in ascending priority: a merged bar shows the last of its results in this order."""
_WEIGHT = np.argsort(_BY_WEIGHT)


@dataclass(frozen=True)
class Bar:
    """A bar of the chart. ``x``, ``width``: units of the picture; ``words``: text for tooltips and screen readers."""

    x: float
    width: float
    state: str
    mark: str
    words: str


@dataclass(frozen=True)
class Row:
    """A node and its bars; ``depth``: nesting in subtrees, and in trees ticked by a leaf."""

    node: DescribedNode
    depth: int
    bars: tuple[Bar, ...]


@dataclass(frozen=True)
class Gantt:
    """The chart of a run. ``ticks``: x and label. ``hidden``: number of nodes without a row."""

    rows: tuple[Row, ...]
    ticks: tuple[tuple[float, str], ...]
    hidden: int


def gantt(nodes: NodeList, done: Activities, duration: float) -> Gantt:
    """Return the chart of a run: subtrees and leaves; if there are too many, the shortest ones are omitted."""
    duration = float(max(duration, done.ends.max(initial=0.0))) or 1.0
    by_node = dict(done.by_node())
    shown = [node for node in nodes.depth_first() if node.uid in by_node and _has_row(node)]
    seconds = {node.uid: float((by_node[node.uid].ends - by_node[node.uid].begins).sum()) for node in shown}
    kept = {node.uid for node in sorted(shown, key=lambda node: -seconds[node.uid])[:MAX_ROWS]}
    rows, room = [], MAX_BARS
    for node in shown:
        if node.uid in kept:
            bars = tuple(_bars(by_node[node.uid], WIDTH / duration))[:room]
            room -= len(bars)
            rows.append(Row(node, _depth(nodes, node), bars))
    return Gantt(tuple(rows), tuple(_ticks(duration)), len(shown) - len(rows))


def _has_row(node: DescribedNode) -> bool:
    return node.is_leaf or node.category == "subtree"


def _depth(nodes: NodeList, node: DescribedNode) -> int:
    depth = 0
    while node.parent is not None:
        node = nodes.node(node.parent)
        depth += _has_row(node)
    return depth


def _bars(mine: Activities, scale: float) -> Iterator[Bar]:
    """Merge overlapping bars into one with the most important result; ``scale``: units per second."""
    left = mine.begins * scale
    right = np.maximum(mine.ends * scale, left + LEAST_WIDTH)
    apart = left[1:] > np.maximum.accumulate(right)[:-1] + 0.5
    first = np.flatnonzero(np.append(True, apart))
    begins, ends = mine.begins[first], np.maximum.reduceat(mine.ends, first)
    results = _BY_WEIGHT[np.maximum.reduceat(_WEIGHT[mine.results], first)]
    counts = np.diff(first, append=len(mine))
    for begin, end, result, count in zip(*(a.tolist() for a in (begins, ends, results, counts)), strict=True):
        width = max((end - begin) * scale, LEAST_WIDTH)
        when = f"{begin:.2f} s" if end == begin else f"{begin:.2f} to {end:.2f} s"
        words = f"{when}: {_LOOKS[result].word}" + (f" ({count} times)" if count > 1 else "")
        mark = _LOOKS[result].icon if width >= MARK_WIDTH else ""
        yield Bar(round(begin * scale, 1), round(width, 1), _LOOKS[result].word, mark, words)


def _ticks(duration: float) -> Iterator[tuple[float, str]]:
    step = next((tick for tick in _TICKS if duration / tick <= 12), _TICKS[-1] * math.ceil(duration / 12 / _TICKS[-1]))
    for number in range(int(duration / step) + 1):
        yield round(number * step / duration * WIDTH, 1), f"{number * step:g} s"


TEMPLATES = Path(__file__).parent / "templates"
MAX_DETAILED = 25
"""Largest number of runs described individually."""
MAX_NODES = 400
FAULTS = (*CHEATS, "collisions", "joint_limit_violations", "velocity_limit_violations")
"""Counters of the audit that are shown as faults if they are not 0."""


@dataclass(frozen=True)
class _ShownRun:
    story: RunReport
    chart: Gantt
    work: tuple[tuple[DescribedNode, WorkOfNode], ...]


def report_page(stories: Sequence[RunReport], now: datetime) -> str:
    """Return the page of one run, or of many, in which the unsuccessful ones are described individually."""
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    environment.filters |= {
        "data_url": _data_url,
        "moment": _moment,
        "number": _number,
        "value_text": _value_text,
        "words": lambda name: str(name).replace("_", " "),
    }
    many = len(stories) > 1
    detailed = [story for story in stories if story.outcome != "success"] if many else list(stories)
    shown = [_shown(story) for story in detailed[:MAX_DETAILED]]
    tasks = list(dict.fromkeys(story.task for story in stories))
    first = stories[0]
    page = environment.get_template("page.html").render(
        title=f"Runs of {', '.join(tasks[:4])}" if many else f"{first.title}: {first.outcome}",
        style=Markup(css_variables() + (TEMPLATES / "style.css").read_text(encoding="utf-8")),  # noqa: S704 - our own files
        version=version("bestman-bt"),
        made=now.strftime("%Y-%m-%d %H:%M"),
        stories=stories,
        runs=shown,
        hidden=len(detailed) - len(shown),
        anchors={run.story.folder: f"run-{number}" for number, run in enumerate(shown)},
        groups=task_groups(stories) if many else [],
        causes=causes(stories) if many else [],
        slow=slow_nodes(stories) if many else [],
        faults=FAULTS,
    )
    return page.encode("utf-8", "replace").decode("utf-8")  # JSON and file names may hold halves of characters


def _shown(story: RunReport) -> _ShownRun:
    work = work_of_nodes(story.activities)
    listed = [(node, work[node.uid]) for node in story.nodes.depth_first() if node.uid in work]
    listed.sort(key=lambda item: -item[1].seconds)
    chart = gantt(story.nodes, story.activities, story.duration)
    return _ShownRun(story, chart, tuple(listed[:MAX_NODES]))


def _data_url(picture: ReportPicture) -> str:
    return f"data:image/jpeg;base64,{base64.b64encode(picture.jpeg).decode()}"


def _moment(started: float | None) -> str:
    if started is None or not 0 <= started < 4e10:
        return ""
    return datetime.fromtimestamp(started).strftime("%Y-%m-%d %H:%M:%S")


def _number(value: Any) -> str:
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    value += 0.0  # -0.0 is 0
    return f"{value:.0f}" if float(value).is_integer() else f"{value:.3g}" if abs(value) < 1 else f"{value:.1f}"


def _value_text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_value_text(v)}" for key, v in value.items())
    if isinstance(value, list | tuple):
        return " and ".join(_value_text(v) for v in value)
    return _number(value) if isinstance(value, float) else str(value)
