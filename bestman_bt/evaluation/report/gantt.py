"""The timeline of a run as a Gantt chart: a row per subtree and leaf, a bar for each time that it was at work."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.evaluation.report.activities import Activity
from bestman_bt.evaluation.report.story import NodeKey, StoryNode

NO = -1
"""Beside the states: a condition whose answer is no, which is its work and no fault, unless it ended the tree."""
WORDS = {SUCCESS: "success", FAILURE: "failure", SKIPPED: "skipped", IDLE: "halted", RUNNING: "running", NO: "no"}
MARKS = {SUCCESS: "✓", FAILURE: "✕", IDLE: "◌", RUNNING: "…", SKIPPED: "↷", NO: "–"}
WIDTH = 1000.0
"""Units of the picture for the whole run; the rows are 22 high."""
LEAST_WIDTH = 2.0
MARK_WIDTH = 14.0
"""From this width on, a bar also carries its mark."""
MAX_ROWS = 150
MAX_BARS = 6000
_TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
_WEIGHT = {SKIPPED: 0, SUCCESS: 1, NO: 2, IDLE: 3, RUNNING: 4, FAILURE: 5}


@dataclass(frozen=True)
class Bar:
    """``x`` and ``width`` in units of the picture; ``words``: what it shows, for pointers and screen readers."""

    x: float
    width: float
    state: str
    mark: str
    words: str


@dataclass(frozen=True)
class Row:
    """A node and its bars."""

    node: StoryNode
    bars: tuple[Bar, ...]


@dataclass(frozen=True)
class Gantt:
    """``ticks``: x and label. ``left_out``: nodes without a row, as there are too many."""

    rows: tuple[Row, ...]
    ticks: tuple[tuple[float, str], ...]
    left_out: int


def gantt(
    nodes: Sequence[StoryNode],
    done: Sequence[Activity[NodeKey]],
    duration: float,
    ended_by: tuple[NodeKey, float] | None = None,
) -> Gantt:
    """The chart of a run; conditions that always returned the same at once have no row where room is short.

    ``ended_by``: the leaf by which the tree failed, and when.
    """
    conditions = {node.key for node in nodes if node.category == "condition"}
    duration = max([duration, *(activity.end for activity in done)], default=duration) or 1.0
    by_node: dict[NodeKey, list[Activity[NodeKey]]] = {}
    for activity in done:
        answers = activity.key in conditions and (activity.key, activity.end) != ended_by
        shown_so = replace(activity, result=NO) if answers and activity.result == FAILURE else activity
        by_node.setdefault(activity.key, []).append(shown_so)
    shown = [node for node in nodes if node.key in by_node and (node.is_leaf or node.category == "subtree")]
    ranked = sorted(shown, key=lambda node: -sum(a.duration for a in by_node[node.key]))
    kept = {node.key for node in ranked[:MAX_ROWS]}
    rows, room = [], MAX_BARS
    for node in shown:
        if node.key in kept:
            bars = tuple(_bars(by_node[node.key], duration))[:room]
            room -= len(bars)
            rows.append(Row(node, bars))
    return Gantt(tuple(rows), tuple(_ticks(duration)), len(shown) - len(rows))


def _bars(mine: Sequence[Activity[NodeKey]], duration: float) -> Iterator[Bar]:
    """Bars that would cover one another become one, which shows the state that matters most."""
    scale = WIDTH / duration
    group: list[Activity[NodeKey]] = []
    for activity in mine:
        if group and activity.begin * scale > max(_right(a, scale) for a in group[-8:]) + 0.5:
            yield _bar(group, scale)
            group = []
        group.append(activity)
    if group:
        yield _bar(group, scale)


def _right(activity: Activity[NodeKey], scale: float) -> float:
    return max(activity.end * scale, activity.begin * scale + LEAST_WIDTH)


def _bar(group: Sequence[Activity[NodeKey]], scale: float) -> Bar:
    begin, end = group[0].begin, max(activity.end for activity in group)
    result = max((activity.result for activity in group), key=lambda result: _WEIGHT[result])
    x, width = begin * scale, max((end - begin) * scale, LEAST_WIDTH)
    when = f"{begin:.2f} s" if end == begin else f"{begin:.2f} to {end:.2f} s"
    words = f"{when}: {WORDS[result]}" + (f" ({len(group)} times)" if len(group) > 1 else "")
    return Bar(round(x, 1), round(width, 1), WORDS[result], MARKS[result] if width >= MARK_WIDTH else "", words)


def _ticks(duration: float) -> Iterator[tuple[float, str]]:
    step = next((tick for tick in _TICKS if duration / tick <= 12), _TICKS[-1] * math.ceil(duration / 12 / _TICKS[-1]))
    for number in range(int(duration / step) + 1):
        yield round(number * step / duration * WIDTH, 1), f"{number * step:g} s"
