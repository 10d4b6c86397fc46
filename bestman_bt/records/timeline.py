"""The timeline of a run: states of leaves and subtrees over time, and marks of events."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.states import NO


@dataclass(frozen=True, eq=False)
class Activities:
    """Activity i: node ``uids[i]`` was active from ``begins[i]`` to ``ends[i]``, seconds; in the order of the starts.

    ``results``: SUCCESS, FAILURE, NO or SKIPPED; IDLE if it was halted; RUNNING at the end of the record.
    """

    uids: NDArray[np.unsignedinteger]
    begins: NDArray[np.float64]
    ends: NDArray[np.float64]
    results: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.uids)

    def by_node(self) -> Iterator[tuple[int, Activities]]:
        """Yield each node with its own activities, in the order of the tree."""
        order = np.argsort(self.uids, kind="stable")
        nodes, begins = np.unique(self.uids[order], return_index=True)
        for uid, mine in zip(nodes.tolist(), np.split(order, begins[1:]), strict=False):
            yield uid, self[mine]

    def __getitem__(self, which: NDArray[np.integer] | NDArray[np.bool_]) -> Activities:
        return Activities(self.uids[which], self.begins[which], self.ends[which], self.results[which])


def activities(changes: Transitions, end: float) -> Activities:
    """Return the activities of state changes, in the order of time and without repetitions; ``end``: of the record,
    seconds.

    A result that follows a result without IDLE or RUNNING in between is a new activity: a node that returns immediately
    is never seen running.
    """
    order = np.argsort(changes.uids, kind="stable")
    uids, times, states = changes.uids[order], changes.times[order], changes.statuses[order]
    follows = np.zeros(len(uids), bool)
    follows[1:] = uids[1:] == uids[:-1]
    ran = np.zeros(len(uids), bool)
    ran[1:] = follows[1:] & (states[:-1] == RUNNING)
    begins = times.copy()
    begins[ran] = times[np.flatnonzero(ran) - 1]
    ended = (states != RUNNING) & (ran | (states != IDLE))
    lasting = (states == RUNNING) & ~np.append(follows[1:], False)[: len(uids)]
    times[lasting] = np.maximum(end, times[lasting])
    kept = np.flatnonzero(ended | lasting)
    kept = kept[np.argsort(begins[kept], kind="stable")]
    return Activities(uids[kept], begins[kept], times[kept], states[kept])


@dataclass(frozen=True)
class WorkOfNode:
    """Statistics of a node's activities; ``seconds``: total duration; ``longest``: duration of the longest one."""

    count: int
    successes: int
    failures: int
    seconds: float
    longest: float


def work_of_nodes(done: Activities) -> dict[int, WorkOfNode]:
    """Return node → its work; a false condition counts as a failure."""
    return {
        uid: WorkOfNode(
            count=len(mine),
            successes=int((mine.results == SUCCESS).sum()),
            failures=int(((mine.results == FAILURE) | (mine.results == NO)).sum()),
            seconds=float((mine.ends - mine.begins).sum()),
            longest=float((mine.ends - mine.begins).max()),
        )
        for uid, mine in done.by_node()
    }


def outcomes(changes: Transitions) -> Transitions:
    """Return the results in order: SUCCESS and FAILURE.

    A repeated result without a run in between is omitted: how often a condition is checked depends on the duration of
    other actions.
    """
    states = np.where(changes.statuses == NO, FAILURE, changes.statuses).astype(np.uint8)
    kept = np.flatnonzero((states == RUNNING) | (states == SUCCESS) | (states == FAILURE))
    news = Transitions(changes.times[kept], changes.uids[kept], states[kept]).without_repetitions()
    returned = news.statuses != RUNNING
    return Transitions(news.times[returned], news.uids[returned], news.statuses[returned])


MAX_SPANS = 20_000
"""Largest number of spans; beyond it the timeline gets coarser: spans closer than the resolution are merged."""
MAX_MARKS = 2_000
FINEST = 0.02
LONGEST = 1e9
"""Seconds."""
_BY_WEIGHT = np.array([IDLE, SKIPPED, RUNNING, SUCCESS, NO, FAILURE], np.uint8)
"""States in ascending priority: a merged span shows the last of its states in this order, first of all a failure."""
_WEIGHT = np.argsort(_BY_WEIGHT)
_SPAN = np.dtype([("uid", "u4"), ("state", "u1"), ("is_merged", "?"), ("begin", "f8"), ("end", "f8")])


class Timeline:
    """Collects spans of the nodes that were added; all times in seconds since the run's start."""

    def __init__(self, max_spans: int = MAX_SPANS) -> None:
        self._max_spans = max_spans
        self._followed = np.zeros(1, bool)
        self._open = np.zeros(1, _SPAN)  # by uid; IDLE where none is
        self._pieces: list[NDArray[Any]] = []
        self._count = 0
        self._resolution = FINEST
        self._marks: list[dict[str, Any]] = []

    def add_node(self, uid: int) -> None:
        """Add a node to the timeline."""
        more = uid + 1 - len(self._followed)
        if more > 0:
            self._followed = np.append(self._followed, np.zeros(more, bool))
            self._open = np.append(self._open, np.zeros(more, _SPAN))
        self._followed[uid] = True

    def change(self, changes: Transitions) -> None:
        """Record state changes, in the order of time."""
        known = changes.uids < len(self._followed)
        known[known] = self._followed[changes.uids[known]]
        order = np.flatnonzero(known)[np.argsort(changes.uids[known], kind="stable")]
        if not len(order):
            return
        begun = np.zeros(len(order), _SPAN)
        begun["uid"], begun["state"], begun["begin"] = (
            changes.uids[order],
            changes.statuses[order],
            changes.times[order],
        )
        first = np.append(True, begun["uid"][1:] != begun["uid"][:-1])
        ended = self._open[begun["uid"]]  # what each change ended
        ended[~first] = begun[:-1][~first[1:]]
        ended["uid"], ended["end"] = begun["uid"], begun["begin"]
        self._open[begun["uid"]] = begun  # the last one of each node stays
        ended = ended[ended["state"] != IDLE]
        self._pieces.append(ended)
        self._count += len(ended)
        if self._count > self._max_spans:
            self._merge()
            while self._count > max(self._max_spans // 2, self._followed.sum()) and self._resolution < LONGEST:
                self._resolution *= 2
                self._merge()

    def mark(self, time: float, kind: str, text: str, node: int | None = None) -> None:
        """Add a mark to the timeline; beyond the limit, every second mark of the older half is dropped."""
        self._marks.append({"time": time, "kind": kind, "text": text} | ({} if node is None else {"node": node}))
        if len(self._marks) > MAX_MARKS:
            del self._marks[1 : MAX_MARKS // 2 : 2]

    def document(self, now: float) -> dict[str, Any]:
        """Return ``spans`` and ``marks`` for JSON. An open span ends at ``now``; combined spans have ``merged`` set."""
        self._merge()
        going_on = self._open[self._open["state"] != IDLE]
        going_on["end"] = np.maximum(going_on["begin"], now)
        spans = np.concatenate([*self._pieces, going_on])
        spans = spans[np.argsort(spans["uid"], kind="stable")]
        merged_spans = [
            {"uid": uid, "state": state, "from": round(begin, 3), "to": round(end, 3)}
            | ({"merged": True} if is_merged else {})
            for uid, state, is_merged, begin, end in spans.tolist()
        ]
        return {"spans": merged_spans, "marks": sorted(self._marks, key=lambda mark: mark["time"])}

    def _merge(self) -> None:
        """Merge spans of one node that together are shorter than the resolution."""
        if not self._pieces:
            return
        spans = np.concatenate(self._pieces)
        spans = spans[np.argsort(spans["uid"], kind="stable")]
        cell, end_cell = (np.floor(spans[side] / self._resolution) for side in ("begin", "end"))
        joins = (cell == end_cell) & (spans["end"] - spans["begin"] < self._resolution)
        follows = (spans["uid"][1:] == spans["uid"][:-1]) & joins[1:] & joins[:-1] & (cell[1:] == cell[:-1])
        begins = np.flatnonzero(np.append(True, ~follows)) if len(spans) else np.zeros(0, np.intp)
        merged = spans[begins]
        if len(begins):
            merged["end"] = np.maximum.reduceat(spans["end"], begins)
            merged["state"] = _BY_WEIGHT[np.maximum.reduceat(_WEIGHT[spans["state"]], begins)]
            merged["is_merged"] |= np.diff(begins, append=len(spans)) > 1
        self._pieces, self._count = [merged], len(merged)
