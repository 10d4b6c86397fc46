"""Parts of an evaluation for several machines: the episodes of a shard, and the union of all journals."""

from __future__ import annotations

import heapq
import json
import os
import resource
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from statistics import fmean
from typing import Any, TypeVar

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.journal import EpisodeKey, Journal, StoredEpisodes, read_episodes, result_of

T = TypeVar("T")

SLURM = "slurm"
TIMES = ("wall_time_s", "real_time_factor")
"""Fields that may differ between two runs of one episode."""
SPARE_FILES = 256
"""Files that a process may open besides those of the shards that it merges."""


@dataclass(frozen=True)
class Shard:
    """One part of an evaluation: ``number`` from 1 to ``of``."""

    number: int
    of: int

    @classmethod
    def parse(cls, text: str, environment: Mapping[str, str] = os.environ) -> Shard:
        """Parse ``3/16``, or ``slurm`` for the array task of this process. Raises ConfigurationError."""
        if text == SLURM:
            return cls._of_slurm(environment)
        number, _, of = text.partition("/")
        if not (number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
            raise _problem(f"should be K/N with 1 ≤ K ≤ N, such as 3/16, or {SLURM}, got '{text}'")
        return cls(int(number), int(of))

    @classmethod
    def _of_slurm(cls, environment: Mapping[str, str]) -> Shard:
        names = [f"SLURM_ARRAY_TASK_{what}" for what in ("ID", "MIN", "MAX", "STEP")]
        missing = [name for name in names[:3] if not environment.get(name, "").isdecimal()]
        if missing:
            raise _problem(f"{SLURM} needs an array job (sbatch --array=1-16): {', '.join(missing)} is not set")
        task, first, last = (int(environment[name]) for name in names[:3])
        step = int(environment.get(names[3], "1"))
        if (task - first) % step or not first <= task <= last:
            raise _problem(f"{SLURM}: task {task} is none of {first} to {last} in steps of {step}")
        return cls((task - first) // step + 1, (last - first) // step + 1)

    def part(self, episodes: Sequence[T], seconds: Sequence[float] | None = None) -> list[T]:
        """Return the episodes of this shard, in the order of ``episodes``: every ``of``-th one.

        With the ``seconds`` of each, episodes are assigned longest first, each to the shard with the lowest load.
        """
        if seconds is None:
            return list(episodes[self.number - 1 :: self.of])
        busy = [0.0] * self.of
        mine = []
        for index in sorted(range(len(episodes)), key=lambda index: (-seconds[index], index)):
            shard = min(range(self.of), key=busy.__getitem__)
            busy[shard] += seconds[index]
            if shard == self.number - 1:
                mine.append(index)
        return [episodes[index] for index in sorted(mine)]

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


class KnownDurations:
    """Wall times of the episodes below a folder, to balance the shards."""

    def __init__(self, folder: Path) -> None:
        self._episodes: dict[tuple[str, int], float] = {}
        configs: dict[str, list[float]] = {}
        for path in find_journals([folder]):
            for key, result in read_episodes(path).read():
                self._episodes[key.config, key.seed] = result.wall_time_s
                configs.setdefault(key.config, []).append(result.wall_time_s)
        self._configs = {config: fmean(times) for config, times in configs.items()}
        self._all = fmean(self._episodes.values()) if self._episodes else 1.0

    def seconds(self, config: str, seed: int) -> float:
        """Return the wall time of this episode, seconds, else the mean of its configuration, else of all."""
        return self._episodes.get((config, seed), self._configs.get(config, self._all))


def find_journals(folders: Iterable[Path]) -> list[Path]:
    """Return every journal below the folders. Raises ConfigurationError if one has none."""
    found: dict[Path, None] = {}
    problems = []
    for folder in folders:
        below = sorted(folder.rglob("episodes.jsonl"))
        if not below or not any(path.stat().st_size for path in below):
            problems.append(Problem(str(folder), None, "", "has no journal episodes.jsonl with episodes"))
        found |= dict.fromkeys(below)
    if problems:
        raise ConfigurationError(problems)
    return list(found)


def merge_journals(journal: Journal, others: Mapping[Path, StoredEpisodes]) -> None:
    """Add the episodes of other journals to ``journal``, one result of each, and what the journals disagree about: two
    different results of one episode mean that the simulation is not deterministic, or that a disk is faulty.

    A result that ``journal`` already has is kept; which of the others is added does not depend on their order in
    ``others``. Raises JournalError if they cannot be written.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, len(others) + SPARE_FILES)), hard))
    for _, group in groupby(_sorted_lines(others), key=itemgetter(0)):
        found = list(group)
        key = found[0][0]
        if known := key in journal.results:
            found.insert(0, (key, journal.line(key), journal.path))
        conflicts = _conflicts(found) if len({line for _, line, _ in found}) > 1 else []
        kept = found[0][1]
        if conflicts and conflicts != (entry := json.loads(kept)).get("conflicts"):
            journal.add_line(key, json.dumps({**entry, "conflicts": conflicts}).encode() + b"\n", conflicts)
        elif not known:
            journal.add_line(key, kept, json.loads(kept)["conflicts"] if b'"conflicts"' in kept else ())


def _conflicts(found: Sequence[tuple[EpisodeKey, bytes, Path]]) -> list[str]:
    """Return how results of one episode, as their lines, differ from the first, and what was known of that before."""
    (_, kept, first), *others = found
    conflicts: dict[str, None] = dict.fromkeys(json.loads(kept).get("conflicts", ()))
    mine = result_of(kept).to_document()
    for _, line, path in others:
        if differing := ", ".join(_differing(mine, result_of(line).to_document())):
            conflicts[f"{first} and {path} differ in {differing}"] = None
        conflicts |= dict.fromkeys(json.loads(line).get("conflicts", ()))
    return list(conflicts)


def _sorted_lines(journals: Mapping[Path, StoredEpisodes]) -> Iterator[tuple[EpisodeKey, bytes, Path]]:
    """Yield the episodes of all journals, which are open meanwhile, those of one key sorted by their lines."""

    def of_one(episodes: StoredEpisodes, path: Path) -> Iterator[tuple[EpisodeKey, bytes, Path]]:
        return ((key, line, path) for key, line in episodes.lines())

    return heapq.merge(*(of_one(episodes, path) for path, episodes in journals.items()), key=_place)


def _place(episode: tuple[EpisodeKey, bytes, Path]) -> tuple[str, str, int, bytes]:
    key, line, _ = episode
    return key.config, key.code, key.seed, line


def _differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> Iterator[str]:
    return (name for name in one if name not in TIMES and one[name] != other.get(name))


def _problem(message: str) -> ConfigurationError:
    return ConfigurationError([Problem("--shard", None, "", message)])
