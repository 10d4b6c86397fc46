"""A log file that is cut into segments: those that are full are compressed, and the oldest are given up.

Beside ``name.suffix``, which grows, stand ``name.0001.suffix.xz`` and so on. A process may be killed at any moment:
what was flushed is there, once.
"""

from __future__ import annotations

import errno
import lzma
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

# Files of folders that others may have made: only regular ones are read, and none without a bound.


@contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """The file, to be read; a pipe or a device, which might never answer, is not waited for.

    Raises:
        OSError: it cannot be opened, or is no regular file.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
    with os.fdopen(descriptor, "rb") as file:
        yield file


def read_regular(path: Path, limit: int) -> bytes:
    """All of a file that has at most ``limit`` bytes.

    Raises:
        OSError: it cannot be read, is no regular file, or has more.
    """
    with open_regular(path) as file:
        content = file.read(limit + 1)
    if len(content) > limit:
        raise OSError(errno.EFBIG, f"it has more than {limit} bytes", str(path))
    return content


COMPRESSED = ".xz"
"""At its quickest preset three times as small as gzip makes such records, in a third of the time."""
UNPACKING_MEMORY = 64 << 20
"""Bytes that unpacking a segment may take."""
SMALLEST = 64 << 10
"""Bytes that a segment counts for at least, so that a folder with many empty ones is not read for ever."""


@dataclass(frozen=True)
class Segment:
    """One that is read. ``is_after_gap``: segments between it and the one before are missing or were left out.

    ``longest``: bytes that are read of it. ``newest``: what the growing file held when the segments were looked for.
    """

    path: Path
    is_after_gap: bool
    longest: int
    newest: bytes | None = None

    @property
    def data(self) -> bytes:
        """Of a full one read whenever it is asked for, so that no long log fills the memory; none if it is gone."""
        if self.newest is not None:
            return self.newest
        packed = self.path if self.path.suffix == COMPRESSED else self.path.with_name(self.path.name + COMPRESSED)
        for path in (self.path, packed):
            with suppress(FileNotFoundError):
                return read_segment(path, self.longest)
        return b""


class SegmentedFile:
    """Writes; the file is replaced, and segments that an earlier log left there are removed.

    ``segment``: bytes after which a new one begins. ``keep``: compressed bytes of full segments; beyond them the oldest
    goes, but for the first. ``head``: what each segment begins with, asked for when it does.
    """

    def __init__(self, path: Path, *, segment: int, keep: int, head: Callable[[], bytes] = bytes) -> None:
        self.path = path
        self._segment, self._keep, self._head = segment, keep, head
        self._number = 0
        for old in path.parent.glob(f"{path.stem}.[0-9][0-9][0-9][0-9]{path.suffix}*"):
            old.unlink()
        self._file = self._begun()

    def write(self, data: bytes) -> None:
        """Append whole records."""
        if self._size + len(data) > self._segment and self._size:
            self._turn()
        self._file.write(data)
        self._size += len(data)

    def flush(self) -> None:
        """Hand everything that was written to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """End the log."""
        self._file.close()

    def _begun(self) -> BinaryIO:
        file = self.path.open("wb")
        file.write(self._head())
        file.flush()  # a log without its head cannot be read
        self._size = 0
        return file

    def _turn(self) -> None:
        self._file.close()
        self._number += 1
        full = self.path.with_name(f"{self.path.stem}.{self._number:04}{self.path.suffix}")
        self.path.replace(full)
        self._file = self._begun()
        part = full.with_name(full.name + ".part")
        with full.open("rb") as source, lzma.open(part, "wb", preset=0) as target:
            shutil.copyfileobj(source, target)
        part.replace(full.with_name(full.name + COMPRESSED))
        full.unlink()
        kept = [path for path in full_segments(self.path) if path.suffix == COMPRESSED]
        while len(kept) > 2 and sum(path.stat().st_size for path in kept) > self._keep:
            kept.pop(1).unlink()


def full_segments(path: Path) -> list[Path]:
    """The segments that stand beside ``path``, oldest first; of one that was being compressed, the one to read."""
    numbered: dict[str, Path] = {}
    for found in sorted(path.parent.glob(f"{path.stem}.[0-9][0-9][0-9][0-9]{path.suffix}*")):
        if found.suffix in (COMPRESSED, path.suffix):
            numbered[found.name[: len(path.stem) + 5]] = found
    return [numbered[name] for name in sorted(numbered)]


def read_segments(path: Path, limit: int, longest: int) -> list[Segment]:
    """The file and its earlier segments, oldest first, with at most ``limit`` bytes together.

    Of a longer log the first segment and the newest ones. ``longest``: bytes that are read of one full segment. All are
    unpacked once here, to count them, and again when they are read.

    Raises:
        OSError: one cannot be read, or is no regular file.
    """
    full = full_segments(path)
    try:
        newest = [Segment(path, False, limit, read_segment(path, limit))]
    except FileNotFoundError:
        if not full:
            raise
        newest = []  # the process ended between two segments
    first = [Segment(found, False, longest) for found in full[:1]]
    left = limit - sum(len(segment.data) for segment in first + newest)
    for found in reversed(full[1:]):
        segment = Segment(found, False, longest)
        left -= max(SMALLEST, len(segment.data))
        if left < 0:
            break
        newest.append(segment)
    due = 0
    read: list[Segment] = []
    for segment in first + newest[::-1]:
        growing = _number(path, full[-1]) + 1 if full else 1
        number = growing if segment.path == path else _number(path, segment.path)
        read.append(replace(segment, is_after_gap=bool(read) and number != due))
        due = number + 1
    return read


def first_segment(path: Path) -> Path:
    """The one that begins the log."""
    return [*full_segments(path)[:1], path][0]


def _number(path: Path, segment: Path) -> int:
    return int(segment.name[len(path.stem) + 1 : len(path.stem) + 5])


def read_segment(path: Path, limit: int) -> bytes:
    """The bytes of a segment, at most ``limit`` of them; one that is cut off or damaged ends early.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    with open_regular(path) as file:
        if path.suffix != COMPRESSED:
            # Room is made for all that is asked for.
            return file.read(min(limit, os.fstat(file.fileno()).st_size))
        unpacker = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=UNPACKING_MEMORY)
        pieces: list[bytes] = []
        try:
            while limit > 0 and not unpacker.eof:
                packed = file.read(1 << 16) if unpacker.needs_input else b""
                if unpacker.needs_input and not packed:
                    break
                piece = unpacker.decompress(packed, limit)
                pieces.append(piece)
                limit -= len(piece)
        except lzma.LZMAError:
            return b"".join(pieces)
    return b"".join(pieces)
