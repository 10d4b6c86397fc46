"""The timeline of a run: when each leaf and subtree was in which state, and marks of what happened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.node_states import NO

MAX_SPANS = 20_000
"""Beyond it the timeline gets coarser: spans that are nearer than the resolution become one."""
MAX_MARKS = 2_000
FINEST = 0.02
"""Seconds."""
_WEIGHT = {SKIPPED: 0, RUNNING: 1, SUCCESS: 2, NO: 3, FAILURE: 4}
"""Which state a merged span shows: what it came to, and a failure before all."""


@dataclass
class _Span:
    state: int
    begin: float
    end: float
    is_merged: bool = False


class Timeline:
    """Collects spans of the nodes that were added; all times in seconds since the run's start."""

    def __init__(self, max_spans: int = MAX_SPANS) -> None:
        self._max_spans = max_spans
        self._spans: dict[int, list[_Span]] = {}
        self._open: dict[int, _Span] = {}
        self._count = 0
        self._resolution = FINEST
        self._marks: list[dict[str, Any]] = []

    def add_node(self, uid: int) -> None:
        """Follow a node."""
        self._spans.setdefault(uid, [])

    def change(self, uid: int, state: int, time: float) -> None:
        """A node has taken a state."""
        spans = self._spans.get(uid)
        if spans is None:
            return
        ended = self._open.pop(uid, None)
        if ended is not None:
            ended.end = time
            if spans and ended.end - spans[-1].begin < self._resolution:
                spans[-1] = _merged(spans[-1], ended)
            else:
                spans.append(ended)
                self._count += 1
                if self._count > self._max_spans:
                    self._coarsen()
        if state != IDLE:
            self._open[uid] = _Span(state, time, time)

    def mark(self, time: float, kind: str, text: str, node: int | None = None) -> None:
        """Note that something happened; beyond the bound, every second one of the older half is dropped."""
        self._marks.append({"time": time, "kind": kind, "text": text} | ({} if node is None else {"node": node}))
        if len(self._marks) > MAX_MARKS:
            del self._marks[1 : MAX_MARKS // 2 : 2]

    def document(self, now: float) -> dict[str, Any]:
        """``spans`` and ``marks``; a span that is not over ends now, one of several that became one is ``merged``."""
        spans = [
            {"uid": uid, "state": span.state, "from": round(span.begin, 3), "to": round(end, 3)}
            | ({"merged": True} if span.is_merged else {})
            for uid, mine in self._spans.items()
            for span, end in [(span, span.end) for span in mine] + self._unfinished(uid, now)
        ]
        return {"spans": spans, "marks": list(self._marks)}

    def _unfinished(self, uid: int, now: float) -> list[tuple[_Span, float]]:
        span = self._open.get(uid)
        return [] if span is None else [(span, max(span.begin, now))]

    def _coarsen(self) -> None:
        """Double the resolution until half of the room is free."""
        while self._count > self._max_spans // 2:
            self._resolution *= 2
            self._count = 0
            for uid, spans in self._spans.items():
                kept: list[_Span] = []
                for span in spans:
                    if kept and span.end - kept[-1].begin < self._resolution:
                        kept[-1] = _merged(kept[-1], span)
                    else:
                        kept.append(span)
                self._spans[uid] = kept
                self._count += len(kept)
            if self._count <= len(self._spans):
                return


def _merged(first: _Span, second: _Span) -> _Span:
    state = max(first.state, second.state, key=_WEIGHT.__getitem__)
    return _Span(state, first.begin, second.end, is_merged=True)
