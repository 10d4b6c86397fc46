"""A log file that is cut into segments: those that are full are compressed, and the oldest are given up.

Beside ``name.suffix``, which grows, stand ``name.0001.suffix.xz`` and so on. A process may be killed at any moment:
what was flushed is there, once.
"""

from __future__ import annotations

import lzma
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from bestman_bt.engine.logs.regular_file import open_regular

COMPRESSED = ".xz"
"""At its quickest preset three times as small as gzip makes such records, in a third of the time."""
UNPACKING_MEMORY = 64 << 20
"""Bytes that unpacking a segment may take."""
NEWEST_READ = 3
"""Full segments that readers take besides the first: a log of many hours, or a hostile one, fits no memory."""


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


def segments_to_read(path: Path) -> list[Path]:
    """The file and its earlier segments, oldest first; of a very long log only the first and the newest ones."""
    full = full_segments(path)
    return [*full[:1], *full[1:][-NEWEST_READ:], path]


def read_segment(path: Path, limit: int) -> bytes:
    """The bytes of a segment, at most ``limit`` of them; one that is cut off or damaged ends early.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    with open_regular(path) as file:
        if path.suffix != COMPRESSED:
            return file.read(limit)
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
