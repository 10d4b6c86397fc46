"""The states of all nodes over time: keyframes, and the changes between them."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.records.node_states import NodeStates


@dataclass(frozen=True)
class HistoryLimits:
    """What a history may hold: beyond it, the oldest parts keep only their keyframes, then every second of those.

    ``changes``: 4 bytes each. ``keyframe_bytes``: of all keyframes together. ``chunk``: changes between two keyframes;
    more for large trees, so that a keyframe never outweighs its changes.
    """

    changes: int = 8_000_000
    keyframe_bytes: int = 64_000_000
    chunk: int = 4096


@dataclass(frozen=True)
class Moment:
    """What was at one time: of the last tick at or before it."""

    time: float
    tick: int
    nodes: NodeStates


BYTES_A_NODE = 30
STATES = 8
"""A change is one number: uid × STATES + state."""


class _Chunk:
    """A keyframe, and the ticks after it: tick i changed ``codes[ends[i-1]:ends[i]]``."""

    def __init__(self, time: float, tick: int, nodes: NodeStates) -> None:
        self.time = time
        self.tick = tick
        self.nodes = nodes
        self.times = array("d")
        self.ticks = array("Q")
        self.ends = array("I")
        self.codes = array("I")

    def at(self, time: float, node_count: int) -> Moment:
        nodes, begin = self.nodes.copy(), 0
        nodes.grow(node_count)  # later trees may have brought some since the keyframe
        count = bisect_right(self.times, time)
        for index in range(count):
            stamp, end = self.times[index], self.ends[index]
            for code in self.codes[begin:end]:
                nodes.change(code // STATES, code % STATES, stamp)
            begin = end
        when = (self.times[count - 1], self.ticks[count - 1]) if count else (self.time, self.tick)
        return Moment(*when, nodes)

    def forget_changes(self) -> None:
        self.times, self.ticks, self.ends, self.codes = array("d"), array("Q"), array("I"), array("I")


class StateHistory:
    """``now`` is the newest moment; ``at`` looks back."""

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
        """The earliest time that is held."""
        return self._chunks[0].time if self._chunks else 0.0

    def record(self, time: float, tick: int, changes: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
        """Add what a tick changed: (uid, state); returns those that are new. ``time`` never runs back."""
        time = max(time, self.time) if self._chunks else time
        if not self._chunks or len(self._chunks[-1].codes) >= max(self._limits.chunk, STATES * len(self.now)):
            self._chunks.append(_Chunk(time, tick, self.now.copy()))
            self._thin()
        chunk, now = self._chunks[-1], self.now
        fresh = [(uid, state) for uid, state in changes if now.change(uid, state, time)]
        chunk.codes.extend(uid * STATES + state for uid, state in fresh)
        chunk.times.append(time)
        chunk.ticks.append(max(0, tick))
        chunk.ends.append(len(chunk.codes))
        self._changes += len(fresh)
        self.time, self.tick = time, tick
        return fresh

    def at(self, time: float) -> Moment:
        """The moment at ``time``; the first one that is held where that is earlier."""
        if not self._chunks:
            return Moment(self.time, self.tick, self.now.copy())
        index = bisect_right(self._chunks, time, key=lambda chunk: chunk.time) - 1
        return self._chunks[max(0, index)].at(time, len(self.now))

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
