"""Groot2's transition log, ``.btlog`` (BehaviorTree.CPP's FileLogger2): live writer and reader.

Little endian: the magic ``BTCPP4-FileLogger2``, u8 1, i32 length of the XML, the XML with node numbers, i64 start in
microseconds since the epoch, then 9 bytes per transition: 6 of microseconds since the start, 2 uid, 1 new status.
A long log is split into segments, see ``segmented_file``. Each is a complete log with the start of the first one, and
begins with the nodes that are not idle.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import numpy as np
import numpy.typing as npt

from bestman_bt.engine.core.tree import StateChanges, Tree
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.logs.segmented_file import SegmentedFile, read_segments
from bestman_bt.engine.status import IDLE, SKIPPED
from bestman_bt.engine.xml.writer import full_tree_xml

PIECE = 1 << 14
"""Number of changes that are turned into objects at a time."""


@dataclass(frozen=True, slots=True)
class Transition:
    """One node's new status; ``time`` in seconds since the start of the log."""

    time: float
    uid: int
    status: int


class Transitions(Sequence[Transition]):
    """State changes in the order of the log: ``times`` (N,), seconds; ``uids`` (N,); ``statuses`` (N,) uint8."""

    def __init__(
        self, times: npt.NDArray[np.float64], uids: npt.NDArray[np.unsignedinteger], statuses: npt.NDArray[np.uint8]
    ) -> None:
        self.times = times
        self.uids = uids
        self.statuses = statuses

    @classmethod
    def none(cls) -> Transitions:
        """Return an empty sequence."""
        return cls(np.zeros(0), np.zeros(0, np.uint32), np.zeros(0, np.uint8))

    @classmethod
    def joined(cls, parts: Sequence[Transitions]) -> Transitions:
        """Return the concatenation of ``parts``."""
        return cls(
            np.concatenate([part.times for part in parts]),
            np.concatenate([part.uids for part in parts]),
            np.concatenate([part.statuses for part in parts]),
        )

    def without_repetitions(self) -> Transitions:
        """Return the transitions that changed a state; initially all nodes are IDLE."""
        if not len(self):
            return self
        order = np.argsort(self.uids, kind="stable")
        uids, statuses = self.uids[order], self.statuses[order]
        before = np.roll(statuses, 1)
        before[0] = IDLE
        before[1:][uids[1:] != uids[:-1]] = IDLE
        is_new = np.empty(len(self), dtype=bool)
        is_new[order] = statuses != before
        return Transitions(self.times[is_new], self.uids[is_new], self.statuses[is_new])

    def __len__(self) -> int:
        return len(self.uids)

    @overload
    def __getitem__(self, index: int) -> Transition: ...
    @overload
    def __getitem__(self, index: slice) -> Transitions: ...
    def __getitem__(self, index: int | slice) -> Transition | Transitions:
        if isinstance(index, slice):
            return Transitions(self.times[index], self.uids[index], self.statuses[index])
        return Transition(float(self.times[index]), int(self.uids[index]), int(self.statuses[index]))

    def __iter__(self) -> Iterator[Transition]:
        for at in range(0, len(self), PIECE):
            piece = slice(at, at + PIECE)
            columns = (self.times[piece].tolist(), self.uids[piece].tolist(), self.statuses[piece].tolist())
            yield from map(Transition, *columns)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Transitions):
            return NotImplemented
        return (
            np.array_equal(self.times, other.times)
            and np.array_equal(self.uids, other.uids)
            and np.array_equal(self.statuses, other.statuses)
        )

    __hash__ = None  # type: ignore[assignment]  # arrays can change


MAGIC = b"BTCPP4-FileLogger2"
PROTOCOL = 1
_RECORD = np.dtype([("time", "<u4"), ("time_high", "<u2"), ("uid", "<u2"), ("status", "u1")])
SEGMENT = 8 << 20
"""Bytes of transitions, about 900,000, after which a new segment begins."""
KEEP = 64 << 20
"""Compressed bytes of full segments to keep."""
LONGEST_SEGMENT = 4 * SEGMENT
MOST_READ = 128 << 20
"""Largest number of bytes read from one full segment, and from all together: about 15 million state changes."""


class LogError(EngineError):
    """Raised if a log file is invalid."""


@dataclass(frozen=True)
class BtLog:
    """A log that was read: the tree's XML, the start (seconds since the epoch), and the transitions.

    ``gaps``: intervals without data, in seconds since the start.
    """

    xml: str
    start: float
    transitions: Transitions
    gaps: tuple[tuple[float, float], ...] = ()

    def __iter__(self) -> Iterator[Transition]:
        return iter(self.transitions)


class BtLogWriter:
    """A context manager that writes a tree's state changes to a file until it is closed.

    Times are those of the tree's clock, so a simulated run is replayed at simulated speed.
    """

    def __init__(
        self,
        tree: Tree | str,
        path: str | Path,
        *,
        start: float | None = None,
        listen: bool = True,
        segment: int = SEGMENT,
    ) -> None:
        """Configure the log; ``open`` creates the file.

        Args:
            tree: the tree to listen to, or the XML, with node numbers, of the tree whose changes ``write`` receives.
            path: the file; an existing one is replaced.
            start: seconds since the epoch, the origin of the log's times; now by default.
            listen: False if only ``write`` adds changes.
            segment: bytes of transitions after which a new segment begins.
        """
        self.path = Path(path)
        self._tree = None if isinstance(tree, str) else tree
        self._xml = tree if isinstance(tree, str) else ""
        self._start = start
        self._listens = listen
        self._segment = segment
        self._file: SegmentedFile | None = None
        self._origin = 0.0
        self._stamp = b""
        self._states: dict[int, int] = {}

    def open(self) -> BtLogWriter:
        """Create the file and start listening."""
        start = time.time() if self._start is None else self._start
        xml = self._xml.encode()
        if self._tree is not None:
            self._origin = self._tree.clock.now()
            xml = full_tree_xml(self._tree).encode()
        head = MAGIC + struct.pack("<Bi", PROTOCOL, len(xml)) + xml + struct.pack("<q", round(start * 1e6))
        self._states = {}
        self._file = SegmentedFile(
            self.path, segment=self._segment, keep=KEEP, head=lambda: head + self._records(self._standing())
        )
        if self._tree is not None and self._listens:
            self._tree.subscribe(self._listen)
        return self

    def write(self, seconds: float, changes: Iterable[tuple[int, int]]) -> None:
        """Add the changes (uid, new state) of one moment, ``seconds`` after the start, without unchanged states."""
        if self._file is None:
            return
        states, news = dict(self._states), []
        for uid, state in changes:
            if states.get(uid, IDLE) != state:
                states[uid] = state
                news.append((uid, state))
        self._stamp = max(0, round(seconds * 1e6)).to_bytes(6, "little")
        self._file.write(self._records(news))
        self._states = states

    def _standing(self) -> list[tuple[int, int]]:
        return [(uid, state) for uid, state in self._states.items() if state != IDLE]

    def _records(self, changes: Iterable[tuple[int, int]]) -> bytes:
        stamp = self._stamp
        return b"".join(stamp + struct.pack("<HB", uid, state) for uid, state in changes)

    def _listen(self, changes: StateChanges) -> None:
        self.write(changes.stamp - self._origin, changes)

    def flush(self) -> None:
        """Flush all written data to the operating system."""
        if self._file is not None:
            self._file.flush()

    def close(self) -> None:
        """Stop listening and close the file."""
        if self._tree is not None:
            self._tree.unsubscribe(self._listen)
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> BtLogWriter:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()


def read_btlog(path: str | Path) -> BtLog:
    """Read a ``.btlog`` file, of this package with its earlier segments or of BehaviorTree.CPP; skip a torn last
    record.

    Of a log longer than ``MOST_READ`` bytes, only the first segment and the newest ones are read.

    Raises:
        LogError: it is not such a file.
        OSError: it cannot be read.
    """
    path = Path(path)
    segments = read_segments(path, MOST_READ, LONGEST_SEGMENT)
    head = segments[0].data
    first = _decoded(segments[0].path, head)
    if len(segments) == 1:
        return first
    parts, gaps = [first.transitions], []
    states = np.full(1 << 16, IDLE, dtype=np.uint8)
    states[first.transitions.uids] = first.transitions.statuses
    end, is_gap = first.transitions[-1].time if len(first.transitions) else 0.0, False
    for segment in segments[1:]:
        is_gap |= segment.is_after_gap
        if segment.path == path and head.startswith(segment.data):
            continue  # torn within its head
        try:
            news = _decoded(segment.path, segment.data).transitions
        except LogError:
            is_gap = True
            continue
        if not len(news):
            continue
        if is_gap:
            gaps.append((end, float(news.times[0])))
        parts += [_fallen(states, news), news]
        states[news.uids] = news.statuses
        end, is_gap = float(news.times[-1]), False
    if is_gap:
        gaps.append((end, end))
    return BtLog(first.xml, first.start, Transitions.joined(parts).without_repetitions(), tuple(gaps))


def _fallen(states: npt.NDArray[np.uint8], segment: Transitions) -> Transitions:
    """Return the nodes that stood so before a segment, but do not stand at its beginning: they have become IDLE."""
    standing: set[int] = set()
    for change in segment:
        if change.time != segment.times[0] or change.status == IDLE or change.uid in standing:
            break
        standing.add(change.uid)
    uids = np.array([uid for uid in np.flatnonzero(states != IDLE) if uid not in standing], dtype=np.uint16)
    return Transitions(np.full(len(uids), segment.times[0]), uids, np.full(len(uids), IDLE, dtype=np.uint8))


def _decoded(path: Path, data: bytes) -> BtLog:
    head = len(MAGIC)
    if data[:head] != MAGIC:
        raise LogError(f"{path} is not a .btlog file: it begins with {data[:head]!r} instead of {MAGIC!r}")
    try:
        protocol, length = struct.unpack_from("<Bi", data, head)
        if protocol != PROTOCOL:
            raise LogError(f"{path} has the .btlog version {protocol}; {PROTOCOL} is supported")
        offset = head + 5
        if length < 0 or offset + length + 8 > len(data):
            raise LogError(f"{path} is cut off within its XML")
        xml = data[offset : offset + length].decode()
        (start,) = struct.unpack_from("<q", data, offset + length)
    except (struct.error, UnicodeDecodeError) as error:
        raise LogError(f"{path} is damaged: {error}") from error
    offset += length + 8
    records = np.frombuffer(data, _RECORD, count=(len(data) - offset) // _RECORD.itemsize, offset=offset)
    wrong = np.flatnonzero(records["status"] > SKIPPED)
    if len(wrong):
        raise LogError(f"{path} is damaged: record {wrong[0]} has the status {records['status'][wrong[0]]}")
    times = (records["time"] + records["time_high"] * 2.0**32) * 1e-6
    return BtLog(xml, start * 1e-6, Transitions(times, records["uid"].copy(), records["status"].copy()))
