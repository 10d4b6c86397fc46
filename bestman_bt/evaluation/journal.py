"""The journal of an evaluation: a line of JSON per finished episode, so that an interrupted one goes on."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from bestman_bt.configuration import ConfigurationError, Problem
from bestman_bt.evaluation.result import RunResult


@dataclass(frozen=True)
class EpisodeKey:
    """What decides an episode: the configuration's and the code's fingerprints, and the seed."""

    config: str
    seed: int
    code: str


class Journal:
    """The file ``episodes.jsonl``; only one evaluation at a time may write it. A torn last line does not count."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: IO[str] | None = None
        self._results: dict[EpisodeKey, RunResult] = {}

    def __enter__(self) -> Journal:
        """Read what is there, and take the file; ConfigurationError where that is not possible."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._path.open("a+", encoding="utf-8")
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise self._problem("another evaluation is writing it") from error
        except OSError as error:
            raise self._problem(f"cannot be written: {error.strerror}") from error
        self._file.seek(0)
        whole, newline, torn = self._file.read().rpartition("\n")
        if torn:
            self._file.truncate(len((whole + newline).encode()))
        self._results = _parsed(self._path, whole)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._file is not None
        self._file.close()

    @property
    def results(self) -> Mapping[EpisodeKey, RunResult]:
        """All finished episodes."""
        return self._results

    def add(self, key: EpisodeKey, commit: str, result: RunResult) -> None:
        """Write down a finished episode; it is on the disk when this returns."""
        assert self._file is not None
        entry = {"config": key.config, "seed": key.seed, "code": key.code, "commit": commit}
        entry["result"] = result.to_document()
        self._file.write(json.dumps(entry, allow_nan=False) + "\n")
        self._file.flush()
        self._results[key] = result

    def _problem(self, why: str) -> ConfigurationError:
        return _problem(self._path, why)


def read_episodes(path: Path) -> Mapping[EpisodeKey, RunResult]:
    """The finished episodes of a journal that others may be writing; raises OSError, ConfigurationError."""
    return _parsed(path, path.read_text(encoding="utf-8").rpartition("\n")[0])


def _parsed(path: Path, lines: str) -> dict[EpisodeKey, RunResult]:
    results: dict[EpisodeKey, RunResult] = {}
    for number, line in enumerate(lines.splitlines(), 1):
        try:
            entry: dict[str, Any] = json.loads(line)
            key = EpisodeKey(entry["config"], entry["seed"], entry["code"])
            results[key] = RunResult.from_document(entry["result"])
        except (ValueError, KeyError, TypeError) as error:
            raise _problem(path, f"line {number} is no finished episode: {error!r}") from error
    return results


def _problem(path: Path, why: str) -> ConfigurationError:
    return ConfigurationError([Problem(str(path), None, "", why)])
