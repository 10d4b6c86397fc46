"""Groot2's transition log, ``.btlog`` (BehaviorTree.CPP's FileLogger2): written live, and read back.

Little endian: the magic ``BTCPP4-FileLogger2``, u8 1, i32 length of the XML, the XML with node numbers, i64 start in
microseconds since the epoch, then 9 bytes a transition: 6 of microseconds since the start, 2 uid, 1 new status.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.status import SKIPPED
from bestman_bt.engine.tree import StateChanges, Tree
from bestman_bt.engine.xml.writer import full_tree_xml

MAGIC = b"BTCPP4-FileLogger2"
PROTOCOL = 1
RECORD = 9


class LogError(EngineError):
    """A log file is not what it should be."""


@dataclass(frozen=True)
class Transition:
    """One node's new status; ``time`` in seconds since the start of the log."""

    time: float
    uid: int
    status: int


@dataclass(frozen=True)
class BtLog:
    """A log that was read: the tree's XML, the start (seconds since the epoch), and the transitions."""

    xml: str
    start: float
    transitions: list[Transition]

    def __iter__(self) -> Iterator[Transition]:
        return iter(self.transitions)


class BtLogWriter:
    """Writes a tree's state changes to a file until it is closed; a context manager.

    Times are those of the tree's clock: a simulated run is replayed at simulated speed.
    """

    def __init__(self, tree: Tree, path: str | Path, *, start: float | None = None) -> None:
        """Describe the log; the file is made when it is opened.

        Args:
            tree: the tree to listen to.
            path: the file; it is replaced.
            start: seconds since the epoch that the log's times count from; now by default.
        """
        self.path = Path(path)
        self._tree = tree
        self._start = start
        self._file: BinaryIO | None = None
        self._origin = 0.0

    def open(self) -> BtLogWriter:
        """Make the file and begin to listen."""
        start = time.time() if self._start is None else self._start
        self._origin = self._tree.clock.now()
        xml = full_tree_xml(self._tree).encode()
        self._file = self.path.open("wb")
        self._file.write(MAGIC + struct.pack("<Bi", PROTOCOL, len(xml)) + xml + struct.pack("<q", round(start * 1e6)))
        self._tree.subscribe(self._listen)
        return self

    def _listen(self, changes: StateChanges) -> None:
        if self._file is None:
            return
        stamp = max(0, round((changes.stamp - self._origin) * 1e6)).to_bytes(6, "little")
        self._file.write(
            b"".join(stamp + struct.pack("<HB", *divmod(code, 8)) for code in changes.codes if isinstance(code, int))
        )

    def flush(self) -> None:
        """Hand everything so far to the operating system."""
        if self._file is not None:
            self._file.flush()

    def close(self) -> None:
        """Stop listening and close the file."""
        self._tree.unsubscribe(self._listen)
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> BtLogWriter:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_btlog(path: str | Path) -> BtLog:
    """Read a ``.btlog`` file, ours or one of BehaviorTree.CPP; an incomplete last record is left out.

    Raises:
        LogError: it is no such file.
    """
    data = Path(path).read_bytes()
    head = len(MAGIC)
    if data[:head] != MAGIC:
        raise LogError(f"{path} is no .btlog file: it begins with {data[:head]!r} instead of {MAGIC!r}")
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
    records = data[offset + length + 8 :]
    transitions = []
    for at in range(0, len(records) - RECORD + 1, RECORD):
        uid, status = struct.unpack_from("<HB", records, at + 6)
        if status > SKIPPED:
            raise LogError(f"{path} is damaged: record {at // RECORD} has the status {status}")
        transitions.append(Transition(int.from_bytes(records[at : at + 6], "little") * 1e-6, uid, status))
    return BtLog(xml, start * 1e-6, transitions)
