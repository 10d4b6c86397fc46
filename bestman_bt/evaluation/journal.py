"""The journal of an evaluation: a line of JSON per finished episode, for resuming."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.result import RunResult

SYNC_EVERY = 0.5
"""Seconds: what was written in the last ones may be lost by a power cut, nothing by a killed process."""
WITHOUT_FLOCK = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
"""What a file system answers that has no locks; a lock file takes their place there."""


@dataclass(frozen=True)
class EpisodeKey:
    """The identity of an episode: fingerprints of configuration and code, and the seed."""

    config: str
    seed: int
    code: str


class Journal:
    """The file ``episodes.jsonl``, written by only one evaluation at a time. A torn last line is ignored.

    Damaged lines are dropped, and the original file is saved beside it (``notes``).
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: IO[bytes] | None = None
        self._lock_file: Path | None = None
        self._results: dict[EpisodeKey, RunResult] = {}
        self._synced = 0.0
        self.notes: list[str] = []

    def __enter__(self) -> Journal:
        """Read what is there, and take the file. Raises ConfigurationError if that is not possible."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._path.open("a+b")
            self._lock(self._file)
            self._read(self._file)
        except OSError as error:
            self._close()
            raise _problem(self._path, f"cannot be written: {error.strerror}") from error
        except ConfigurationError:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        assert self._file is not None
        os.fsync(self._file)
        self._close()

    @property
    def results(self) -> Mapping[EpisodeKey, RunResult]:
        """All finished episodes."""
        return self._results

    def add(self, key: EpisodeKey, commit: str, result: RunResult) -> None:
        """Write a finished episode and flush it, so that a killed process does not lose it."""
        assert self._file is not None
        entry = {"config": key.config, "seed": key.seed, "code": key.code, "commit": commit}
        entry["result"] = result.to_document()
        self._file.write(json.dumps(entry, allow_nan=False).encode() + b"\n")
        self._file.flush()
        if time.monotonic() - self._synced >= SYNC_EVERY:
            os.fsync(self._file)
            self._synced = time.monotonic()
        self._results[key] = result

    def _lock(self, file: IO[bytes]) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise _problem(self._path, "another evaluation is writing it") from error
        except OSError as error:
            if error.errno not in WITHOUT_FLOCK:
                raise
            self._make_lock_file(self._path.with_suffix(".lock"))

    def _make_lock_file(self, path: Path) -> None:
        mine = f"process {os.getpid()} on {socket.gethostname()}"
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(mine)
        except FileExistsError as error:
            theirs = path.read_text(encoding="utf-8")
            if not _has_ended(theirs):
                why = f"another evaluation is writing it, {theirs}; if that has ended, delete {path}"
                raise _problem(self._path, why) from error
            path.write_text(mine, encoding="utf-8")
        self._lock_file = path

    def _read(self, file: IO[bytes]) -> None:
        file.seek(0)
        whole, newline, torn = file.read().rpartition(b"\n")
        if torn:
            file.truncate(len(whole + newline))
        self._results, sound, damaged = _parsed(whole)
        if not damaged:
            return
        if not sound:
            raise _damaged(self._path, damaged)
        copy = self._path.with_name(f"{self._path.name}.damaged")
        shutil.copyfile(self._path, copy)
        file.truncate(0)
        file.write(b"".join(line + b"\n" for line in sound))
        file.flush()
        os.fsync(file)
        numbers = ", ".join(map(str, damaged))
        self.notes.append(f"{self._path}: damaged lines were left out ({numbers}); the original file: {copy}")

    def _close(self) -> None:
        if self._lock_file is not None:
            self._lock_file.unlink(missing_ok=True)
        if self._file is not None:
            self._file.close()


def read_episodes(path: Path) -> Mapping[EpisodeKey, RunResult]:
    """Return the finished episodes of a journal, even while it is being written. Raises OSError or
    ConfigurationError."""
    results, _, damaged = _parsed(path.read_bytes().rpartition(b"\n")[0])
    if damaged:
        raise _damaged(path, damaged)
    return results


def _parsed(data: bytes) -> tuple[dict[EpisodeKey, RunResult], list[bytes], dict[int, Exception]]:
    """Return the episodes, the lines that tell them, and what is wrong with which other line."""
    results: dict[EpisodeKey, RunResult] = {}
    sound: list[bytes] = []
    damaged: dict[int, Exception] = {}
    for number, line in enumerate(data.split(b"\n") if data else (), 1):
        try:
            entry: dict[str, Any] = json.loads(line)
            key = EpisodeKey(entry["config"], entry["seed"], entry["code"])
            results[key] = RunResult.from_document(entry["result"])
            sound.append(line)
        except (ValueError, KeyError, TypeError) as error:
            damaged[number] = error
    return results, sound, damaged


def _has_ended(holder: str) -> bool:
    """Return whether a process of this machine, as a lock file names it, is no more."""
    match holder.split():
        case ["process", number, "on", host] if number.isdecimal() and host == socket.gethostname():
            return not Path(f"/proc/{number}").exists()
    return False


def _damaged(path: Path, lines: Mapping[int, Exception]) -> ConfigurationError:
    number, error = next(iter(lines.items()))
    return _problem(path, f"line {number} is not a finished episode: {error!r}")


def _problem(path: Path, why: str) -> ConfigurationError:
    return ConfigurationError([Problem(str(path), None, "", why)])
