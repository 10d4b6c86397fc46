"""The journal of an evaluation: a line of JSON per finished episode, for resuming."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.errors import Error
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.writer_lock import lock_for_writing

SYNC_EVERY = 0.5
"""Seconds: what was written in the last ones may be lost by a power cut, nothing by a killed process."""


class JournalError(Error):
    """Raised if a journal cannot be written any more, as on a full disk; what is in it is kept."""

    code = "journal_not_written"


@dataclass(frozen=True, slots=True)
class EpisodeKey:
    """The identity of an episode: fingerprints of configuration and code, and the seed."""

    config: str
    seed: int
    code: str


class StoredEpisodes(Mapping[EpisodeKey, RunResult]):
    """The episodes of a journal; in memory are only their places in the file, so that millions have room."""

    def __init__(self, path: Path, offsets: dict[EpisodeKey, int]) -> None:
        self._path, self._offsets = path, offsets

    def __getitem__(self, key: EpisodeKey) -> RunResult:
        with self._path.open("rb") as file:
            file.seek(self._offsets[key])
            return _result_of(json.loads(file.readline()))

    def __contains__(self, key: object) -> bool:
        return key in self._offsets

    def __iter__(self) -> Iterator[EpisodeKey]:
        return iter(self._offsets)

    def __len__(self) -> int:
        return len(self._offsets)

    def lines(self) -> Iterator[tuple[EpisodeKey, bytes]]:
        """Yield each episode as its line in the file."""
        with self._path.open("rb") as file:
            for key, offset in self._offsets.items():
                file.seek(offset)
                yield key, file.readline()

    def read(self) -> Iterator[tuple[EpisodeKey, RunResult]]:
        """Yield all episodes; quicker than one by one."""
        for key, line in self.lines():
            yield key, _result_of(json.loads(line))


class Journal:
    """The file ``episodes.jsonl``, written by only one evaluation at a time. A torn last line is ignored.

    Damaged lines are dropped, and the original file is saved beside it (``notes``). A journal without episodes is
    removed at the end, with the folders that were made for it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: IO[bytes] | None = None
        self._lock_file: Path | None = None
        self._offsets: dict[EpisodeKey, int] = {}
        self._end = 0
        self._synced = 0.0
        self._made_folders: list[Path] = []
        self.notes: list[str] = []

    def __enter__(self) -> Journal:
        """Read what is there, and take the file. Raises ConfigurationError if that is not possible."""
        self._made_folders = [folder for folder in self.path.parents if not folder.exists()]
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("a+b")
            self._lock_file = lock_for_writing(self._file, self.path, "evaluation")
            self._read(self._file)
        except OSError as error:
            self._close()
            raise _problem(self.path, f"cannot be written: {error.strerror}") from error
        except ConfigurationError:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Write everything to the disk. Raises JournalError."""
        try:
            self._sync()
        finally:
            if self._end == 0:
                self.path.unlink(missing_ok=True)
            self._close()
            with suppress(OSError):  # something else is in it
                for folder in self._made_folders:
                    folder.rmdir()

    @property
    def results(self) -> StoredEpisodes:
        """All finished episodes."""
        return StoredEpisodes(self.path, self._offsets)

    def add(self, key: EpisodeKey, commit: str, result: RunResult) -> None:
        """Write a finished episode and flush it, so that a killed process does not lose it. Raises JournalError."""
        entry = {"config": key.config, "seed": key.seed, "code": key.code, "commit": commit}
        entry["result"] = result.to_document()
        self.add_line(key, json.dumps(entry, allow_nan=False).encode() + b"\n")

    def add_line(self, key: EpisodeKey, line: bytes) -> None:
        """Write a finished episode as its line in another journal. Raises JournalError."""
        assert self._file is not None
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            raise self._not_written(error) from error
        self._offsets[key] = self._end
        self._end += len(line)
        if time.monotonic() - self._synced >= SYNC_EVERY:
            self._sync()

    def _sync(self) -> None:
        assert self._file is not None
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._not_written(error) from error
        self._synced = time.monotonic()

    def _not_written(self, error: OSError) -> JournalError:
        return JournalError(
            f"{self.path} cannot be written any more: {error.strerror}; the {len(self._offsets)} episodes in it are "
            "kept: make room there and repeat the command"
        )

    def _read(self, file: IO[bytes]) -> None:
        file.seek(0)
        self._offsets, damaged, self._end = _indexed(file)
        file.truncate(self._end)  # without the torn line
        if not damaged:
            return
        if not self._offsets:
            raise _damaged(self.path, damaged)
        copy = self.path.with_name(f"{self.path.name}.damaged")
        shutil.copyfile(self.path, copy)
        file.truncate(0)
        with copy.open("rb") as whole:
            file.writelines(line for number, line in enumerate(whole, 1) if number not in damaged)
        file.flush()
        os.fsync(file)
        file.seek(0)
        self._offsets, _, self._end = _indexed(file)
        numbers = ", ".join(map(str, damaged))
        self.notes.append(f"{self.path}: damaged lines were left out ({numbers}); the original file: {copy}")

    def _close(self) -> None:
        if self._lock_file is not None:
            self._lock_file.unlink(missing_ok=True)
        if self._file is not None:
            with suppress(OSError):  # it writes what could not be written before
                self._file.close()


def read_episodes(path: Path) -> StoredEpisodes:
    """Return the finished episodes of a journal, even while it is being written. Raises OSError or
    ConfigurationError."""
    with path.open("rb") as file:
        offsets, damaged, _ = _indexed(file)
    if damaged:
        raise _damaged(path, damaged)
    return StoredEpisodes(path, offsets)


def _indexed(file: IO[bytes]) -> tuple[dict[EpisodeKey, int], dict[int, Exception], int]:
    """Return where the line of each episode begins, what is wrong with which other line, and where the last whole line
    ends.
    """
    offsets: dict[EpisodeKey, int] = {}
    damaged: dict[int, Exception] = {}
    end = 0
    for number, line in enumerate(file, 1):
        if not line.endswith(b"\n"):
            break
        try:
            entry = json.loads(line)
            _result_of(entry)
            offsets[EpisodeKey(sys.intern(entry["config"]), entry["seed"], sys.intern(entry["code"]))] = end
        except (ValueError, KeyError, TypeError) as error:
            damaged[number] = error
        end += len(line)
    return offsets, damaged, end


def _result_of(entry: Mapping[str, Any]) -> RunResult:
    return RunResult.from_document(entry["result"])


def _damaged(path: Path, lines: Mapping[int, Exception]) -> ConfigurationError:
    number, error = next(iter(lines.items()))
    return _problem(path, f"line {number} is not a finished episode: {error!r}")


def _problem(path: Path, why: str) -> ConfigurationError:
    return ConfigurationError([Problem(str(path), None, "", why)])
