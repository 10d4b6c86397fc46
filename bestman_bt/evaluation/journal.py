"""The journal of an evaluation: a line of JSON per finished episode, for resuming."""

from __future__ import annotations

import json
import os
import shutil
import time
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.errors import Error
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.seed_map import SeedMap
from bestman_bt.evaluation.writer_lock import lock_for_writing

SYNC_EVERY = 0.5
"""Seconds of data that a power cut may lose; a killed process loses nothing."""


class JournalError(Error):
    """Raised if a journal can no longer be written, for example on a full disk; its content is kept."""

    code = "journal_not_written"


@dataclass(frozen=True, slots=True)
class EpisodeKey:
    """The identity of an episode: fingerprints of configuration and code, and the seed."""

    config: str
    seed: int
    code: str


class StoredEpisodes(Mapping[EpisodeKey, RunResult]):
    """The episodes of a journal, sorted by configuration, code and seed.

    ``places``: configuration and code → seed → offset of its line; nothing else is in memory, so that millions fit.
    """

    def __init__(self, path: Path, places: Mapping[tuple[str, str], SeedMap]) -> None:
        self._path, self._places = path, places

    def __getitem__(self, key: EpisodeKey) -> RunResult:
        ((_, result),) = self.read([key])
        return result

    def __contains__(self, key: object) -> bool:
        return isinstance(key, EpisodeKey) and key.seed in self._places.get((key.config, key.code), ())

    def __iter__(self) -> Iterator[EpisodeKey]:
        for config, code in sorted(self._places):
            for seed in self._places[config, code]:
                yield EpisodeKey(config, seed, code)

    def __len__(self) -> int:
        return sum(map(len, self._places.values()))

    def codes(self, config: str, seed: int) -> list[str]:
        """Return the fingerprints of the codes that ran an episode, in the order of time; those whose lines have none,
        of older versions, or a damaged one are first, in the order of their lines.
        """
        found = {code: seeds[seed] for (of, code), seeds in self._places.items() if of == config and seed in seeds}
        keys = [EpisodeKey(config, seed, code) for code in sorted(found, key=found.__getitem__)]
        if len(keys) > 1:
            ended = {key: json.loads(line).get("ended") for key, line in self.lines(keys)}
            keys.sort(key=lambda key: at if isinstance(at := ended[key], str) else "")
        return [key.code for key in keys]

    def read(self, keys: Iterable[EpisodeKey] | None = None) -> Iterator[tuple[EpisodeKey, RunResult]]:
        """Yield these episodes, by default all; quicker than one by one."""
        for key, line in self.lines(keys):
            yield key, result_of(line)

    def lines(self, keys: Iterable[EpisodeKey] | None = None) -> Iterator[tuple[EpisodeKey, bytes]]:
        """Yield these episodes, by default all, as their lines in the file, which is open meanwhile."""
        with self._path.open("rb") as file:
            for key in self if keys is None else keys:
                file.seek(self._places[key.config, key.code][key.seed])
                yield key, file.readline()


class Journal:
    """The file ``episodes.jsonl``, written by only one evaluation at a time. A torn last line is ignored.

    Damaged lines are dropped, and the original file is saved beside it (``notes``). A journal without episodes is
    removed at the end, with the folders that were made for it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: IO[bytes] | None = None
        self._lock_file: Path | None = None
        self._places: dict[tuple[str, str], SeedMap] = {}
        self.conflicts: dict[EpisodeKey, Sequence[str]] = {}
        """What merged journals disagreed about, by episode."""
        self._end = 0
        self._synced = 0.0
        self._made_folders: list[Path] = []
        self.notes: list[str] = []

    def __enter__(self) -> Journal:
        """Read the existing episodes, and lock the file. Raises ConfigurationError if that is not possible."""
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
        return StoredEpisodes(self.path, self._places)

    def line(self, key: EpisodeKey) -> bytes:
        """Return a finished episode as its line."""
        assert self._file is not None
        self._file.seek(self._places[key.config, key.code][key.seed])
        return self._file.readline()

    def add(self, key: EpisodeKey, commit: str, result: RunResult) -> None:
        """Write a finished episode and flush it, so that a killed process does not lose it. Raises JournalError."""
        ended = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = {"config": key.config, "seed": key.seed, "code": key.code, "commit": commit, "ended": ended}
        entry["result"] = result.to_document()
        self.add_line(key, json.dumps(entry, allow_nan=False).encode() + b"\n")

    def add_line(self, key: EpisodeKey, line: bytes, conflicts: Sequence[str] = ()) -> None:
        """Write a finished episode as its line, which holds these conflicts. Raises JournalError."""
        assert self._file is not None
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            raise self._not_written(error) from error
        self._places.setdefault((key.config, key.code), SeedMap())[key.seed] = self._end
        if conflicts:
            self.conflicts[key] = conflicts
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
            f"{self.path} can no longer be written: {error.strerror}; the {len(self.results)} episodes in it are "
            "kept: make room there and repeat the command"
        )

    def _read(self, file: IO[bytes]) -> None:
        file.seek(0)
        self._places, damaged, self._end = _indexed(file, self.conflicts)
        file.truncate(self._end)  # without the torn line
        if not damaged:
            return
        if not self._places:
            raise _damaged(self.path, damaged)
        copy = self.path.with_name(f"{self.path.name}.damaged")
        shutil.copyfile(self.path, copy)
        file.truncate(0)
        with copy.open("rb") as whole:
            file.writelines(line for number, line in enumerate(whole, 1) if number not in damaged)
        file.flush()
        os.fsync(file)
        file.seek(0)
        self._places, _, self._end = _indexed(file, self.conflicts)
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
        places, damaged, _ = _indexed(file, {})
    if damaged:
        remedy = "; repeat the command that wrote it: it leaves such lines out and runs their episodes again"
        raise _damaged(path, damaged, remedy if places else "")
    return StoredEpisodes(path, places)


def result_of(line: bytes) -> RunResult:
    """Return the result in a line of a journal."""
    return RunResult.from_document(json.loads(line)["result"])


def _indexed(
    file: IO[bytes], conflicts: dict[EpisodeKey, Sequence[str]]
) -> tuple[dict[tuple[str, str], SeedMap], dict[int, Exception], int]:
    """Return the start of each episode's line, the faults of the other lines, and the end of the last whole line; add
    the conflicts in the lines.
    """
    found: dict[tuple[str, str], tuple[array[int], array[int]]] = {}
    damaged: dict[int, Exception] = {}
    end = 0
    for number, line in enumerate(file, 1):
        if not line.endswith(b"\n"):
            break
        try:
            entry = json.loads(line)
            RunResult.from_document(entry["result"])
            config, code, seed = entry["config"], entry["code"], entry["seed"]
            disagreement = [str(conflict) for conflict in entry.get("conflicts", ())]
            if not (isinstance(config, str) and isinstance(code, str) and type(seed) is int and abs(seed) < 2**63):
                raise TypeError(
                    f"config and code should be text and seed an integer, got {config!r}, {code!r}, {seed!r}"
                )
        except (ValueError, KeyError, TypeError) as error:
            damaged[number] = error
        else:
            seeds, ends = found.setdefault((config, code), (array("q"), array("q")))
            seeds.append(seed)
            ends.append(end)
            if disagreement:
                conflicts[EpisodeKey(config, seed, code)] = disagreement
        end += len(line)
    return {key: SeedMap(*pairs) for key, pairs in found.items()}, damaged, end


def _damaged(path: Path, lines: Mapping[int, Exception], remedy: str = "") -> ConfigurationError:
    number, error = next(iter(lines.items()))
    return _problem(path, f"line {number} is not a finished episode: {error!r}{remedy}")


def _problem(path: Path, why: str) -> ConfigurationError:
    return ConfigurationError([Problem(str(path), None, "", why)])
