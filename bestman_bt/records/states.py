"""The states of all nodes over time: keyframes, and the changes between them, as arrays."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS

NO = 5
"""A state in addition to the engine's: FAILURE of a condition, that is, a negative result, unless its tree ended
because of it.
"""
BYTES_A_NODE = 30
STATES = 8
"""A stored change is one number: uid × STATES + state."""


class NodeStates:
    """The states of all nodes at one moment, with counters; indexed by uid, element 0 is unused.

    ``results``: the last result since the start, IDLE if none: a parent resets a child right after it returned, so that
    a quick condition would otherwise be invisible. ``starts``: number of starts; ``seconds``: running time, up to
    ``since`` for running nodes.
    """

    def __init__(self, count: int = 0) -> None:
        self.states = np.zeros(count + 1, np.uint8)
        self.results = np.zeros(count + 1, np.uint8)
        self.starts = np.zeros(count + 1, np.uint32)
        self.successes = np.zeros(count + 1, np.uint32)
        self.failures = np.zeros(count + 1, np.uint32)
        self.seconds = np.zeros(count + 1)
        self.since = np.zeros(count + 1)

    def __len__(self) -> int:
        return len(self.states) - 1

    def grown(self, count: int) -> NodeStates:
        """Return a copy with room for ``count`` nodes; new ones are IDLE."""
        other = NodeStates(max(count, len(self)))
        for name, values in vars(self).items():
            getattr(other, name)[: len(values)] = values
        return other

    def apply(self, changes: Transitions) -> NDArray[np.intp]:
        """Apply changes in the order of time; returns the indices of those that change a state.

        A node that returns without having been RUNNING counts as started at that time.
        """
        order = np.argsort(changes.uids, kind="stable")
        uids, states = changes.uids[order], changes.statuses[order]
        follows = np.zeros(len(uids), bool)
        follows[1:] = uids[1:] == uids[:-1]
        before = self.states[uids]
        before[follows] = states[:-1][follows[1:]]
        order = order[fresh := states != before]
        uids, states, before, times = uids[fresh], states[fresh], before[fresh], changes.times[order]
        follows = np.zeros(len(uids), bool)
        follows[1:] = uids[1:] == uids[:-1]
        since = self.since[uids]
        since[follows] = times[:-1][follows[1:]]
        ran = before == RUNNING
        size = len(self.states)
        self.seconds += np.bincount(uids[ran], np.maximum(0.0, times - since)[ran], size)
        self.starts += np.bincount(uids[~ran & (states != IDLE)], minlength=size).astype(np.uint32)
        self.successes += np.bincount(uids[states == SUCCESS], minlength=size).astype(np.uint32)
        self.failures += np.bincount(uids[(states == FAILURE) | (states == NO)], minlength=size).astype(np.uint32)
        # Of several values for one place, numpy keeps the last.
        self.states[uids] = states
        told, runs = states != IDLE, states == RUNNING
        self.results[uids[told]] = np.where(runs, IDLE, states)[told]
        self.since[uids[runs]] = times[runs]
        return np.sort(order)

    def running(self) -> list[int]:
        """Return the uids that run, in the order of the tree."""
        return np.flatnonzero(self.states == RUNNING).tolist()

    def statistics(self, uids: ArrayLike, time: float) -> dict[str, list[float]]:
        """Return uid → starts, successes, failures and seconds of running up to ``time``, for nodes that have
        started.
        """
        told = np.asarray(uids, dtype=np.intp)
        told = told[self.starts[told] > 0]
        runs = np.where(self.states[told] == RUNNING, np.maximum(0.0, time - self.since[told]), 0.0)
        seconds = np.round(self.seconds[told] + runs, 3)
        columns = (told, self.starts[told], self.successes[told], self.failures[told], seconds)
        return {str(uid): counts for uid, *counts in zip(*(column.tolist() for column in columns), strict=True)}


@dataclass(frozen=True)
class HistoryLimits:
    """Limits of a history: beyond them, the oldest parts keep only their keyframes, then only every second keyframe.

    ``changes``: 4 bytes each. ``keyframe_bytes``: of all keyframes together. ``chunk``: changes between two keyframes;
    more for large trees, so that a keyframe never outweighs its changes.
    """

    changes: int = 8_000_000
    keyframe_bytes: int = 64_000_000
    chunk: int = 8192


@dataclass(frozen=True)
class Moment:
    """The state at one time, of the last tick at or before it."""

    time: float
    tick: int
    nodes: NodeStates


class _Chunk:
    """A keyframe, and the moments after it: moment i changed ``codes[ends[i-1]:ends[i]]``."""

    def __init__(self, time: float, tick: int, nodes: NodeStates) -> None:
        self.time = time
        self.tick = tick
        self.nodes = nodes
        self.forget_changes()

    def forget_changes(self) -> None:
        self.times, self.ticks, self.ends, self.codes = array("d"), array("Q"), array("I"), array("I")

    def changes(self, moments: int | None = None) -> Transitions:
        """Return the changes of the first ``moments``; of all by default."""
        ends = np.array(self.ends[:moments], dtype=np.int64)
        codes = np.array(self.codes[: ends[-1]] if len(ends) else (), dtype=np.uint32)
        times = np.repeat(np.array(self.times[:moments]), np.diff(ends, prepend=0))
        return Transitions(times, codes // STATES, (codes % STATES).astype(np.uint8))

    def at(self, time: float, node_count: int) -> Moment:
        nodes = self.nodes.grown(node_count)  # later trees may have brought some since the keyframe
        count = bisect_right(self.times, time)
        nodes.apply(self.changes(count))
        when = (self.times[count - 1], self.ticks[count - 1]) if count else (self.time, self.tick)
        return Moment(*when, nodes)


class StateHistory:
    """``now`` is the newest moment, at ``time`` and ``tick``; ``at`` looks back."""

    def __init__(self, limits: HistoryLimits | None = None) -> None:
        self._limits = limits or HistoryLimits()
        self.now = NodeStates()
        self.time = 0.0
        self.tick = 0
        self._chunks: list[_Chunk] = []
        self._changes = 0
        self._bare = 0  # so many chunks at the beginning are keyframes alone

    @property
    def first(self) -> float:
        """The earliest time in the history, seconds."""
        return self._chunks[0].time if self._chunks else 0.0

    def record(self, time: float, tick: int, changes: Sequence[tuple[int, int]] = ()) -> Transitions:
        """Add a tick with its changes (uid, state); returns those that change a state."""
        uids, states = np.array(changes, dtype=np.uint32).reshape(-1, 2).T
        moments = np.full(len(uids), time)
        fresh = self.extend(Transitions(moments, uids, states.astype(np.uint8)), np.full(len(uids), tick))
        if not changes:
            self.time = max(time, self.time) if self._chunks else time
            self.tick = tick
            self._add(self._chunk_for(self.time, tick), [self.time], [tick], [0])
        return fresh

    def extend(self, changes: Transitions, ticks: NDArray[np.int64]) -> Transitions:
        """Add changes in the order of time, each with its tick; returns those that change a state."""
        times = np.maximum(changes.times, self.time) if self._chunks else changes.times
        fresh = np.zeros(len(changes), bool)
        begin = 0
        while begin < len(changes):
            chunk = self._chunk_for(float(times[begin]), int(ticks[begin]))
            part = slice(begin, begin + max(1, self._room - len(chunk.codes)))
            uids, states = changes.uids[part], changes.statuses[part]
            fresh[part][self.now.apply(Transitions(times[part], uids, states))] = True
            codes = uids[fresh[part]].astype(np.uint32) * STATES + states[fresh[part]]
            last = np.append(times[part][1:] != times[part][:-1], True)  # of its moment
            chunk.codes.frombytes(codes.astype(np.uint32).tobytes())
            ends = np.cumsum(fresh[part])[last]
            self._add(chunk, times[part][last], np.maximum(0, ticks[part])[last], ends)
            begin += len(uids)
        if len(changes):
            self.time, self.tick = float(times[-1]), int(ticks[-1])
        return Transitions(times[fresh], changes.uids[fresh], changes.statuses[fresh])

    def changes(self) -> Transitions:
        """Return all stored changes, in the order of time."""
        return Transitions.joined([chunk.changes() for chunk in self._chunks] or [Transitions.none()])

    def at(self, time: float) -> Moment:
        """Return the moment at ``time``, or the first stored one."""
        if not self._chunks:
            return Moment(self.time, self.tick, self.now.grown(0))
        index = bisect_right(self._chunks, time, key=lambda chunk: chunk.time) - 1
        return self._chunks[max(0, index)].at(time, len(self.now))

    @property
    def _room(self) -> int:
        return max(self._limits.chunk, STATES * len(self.now))

    def _chunk_for(self, time: float, tick: int) -> _Chunk:
        if not self._chunks or len(self._chunks[-1].codes) >= self._room:
            self._chunks.append(_Chunk(time, tick, self.now.grown(0)))
            self._thin()
        return self._chunks[-1]

    def _add(self, chunk: _Chunk, times: ArrayLike, ticks: ArrayLike, counts: ArrayLike) -> None:
        """Add moments; ``counts``: of new changes up to each of them, which are in ``codes`` already."""
        added = np.asarray(counts, dtype=np.uint32)
        before = chunk.ends[-1] if chunk.ends else 0
        chunk.times.frombytes(np.asarray(times, dtype=np.float64).tobytes())
        chunk.ticks.frombytes(np.asarray(ticks, dtype=np.uint64).tobytes())
        chunk.ends.frombytes((added + before).astype(np.uint32).tobytes())
        self._changes += int(added[-1])

    def _thin(self) -> None:
        while self._changes > self._limits.changes and self._bare < len(self._chunks) - 1:
            chunk = self._chunks[self._bare]
            self._changes -= len(chunk.codes)
            chunk.forget_changes()
            self._bare += 1
        most = max(16, self._limits.keyframe_bytes // (BYTES_A_NODE * (len(self.now) + 1)))
        if len(self._chunks) <= most:
            return
        if self._bare < 2:  # a tree so large that its keyframes fill the room first
            self._changes -= sum(len(chunk.codes) for chunk in self._chunks[: most // 2])
            self._bare = most // 2
            for chunk in self._chunks[: self._bare]:
                chunk.forget_changes()
        kept = self._chunks[: self._bare : 2]
        self._chunks[: self._bare] = kept
        self._bare = len(kept)
