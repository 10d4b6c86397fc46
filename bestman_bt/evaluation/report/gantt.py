"""The timeline of a run as a Gantt chart: a row per subtree and leaf, a bar for each time that it was at work."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.activities import Activities
from bestman_bt.records.events import DescribedNode
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import HALTED, LOOKS
from bestman_bt.records.states import NO

_LOOKS = {**LOOKS, IDLE: HALTED}
WIDTH = 1000.0
"""Units of the picture for the whole run; the rows are 22 high."""
LEAST_WIDTH = 2.0
MARK_WIDTH = 14.0
"""From this width on, a bar also carries its mark."""
MAX_ROWS = 150
MAX_BARS = 6000
_TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
_BY_WEIGHT = np.array([SKIPPED, SUCCESS, NO, IDLE, RUNNING, FAILURE])
"""A bar of several activities shows the last of their results here."""
_WEIGHT = np.argsort(_BY_WEIGHT)


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
    """A node and its bars; ``depth``: how many subtrees, and trees that a leaf ticked, it is in."""

    node: DescribedNode
    depth: int
    bars: tuple[Bar, ...]


@dataclass(frozen=True)
class Gantt:
    """``ticks``: x and label. ``left_out``: nodes without a row, as there are too many."""

    rows: tuple[Row, ...]
    ticks: tuple[tuple[float, str], ...]
    left_out: int


def gantt(nodes: NodeList, done: Activities, duration: float) -> Gantt:
    """The chart of a run: subtrees and leaves; where room is short, those that took the least time have no row."""
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
    """Bars that would cover one another become one, of the result that matters most; ``scale``: units a second."""
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
