"""Reads the results of an evaluation from its folder, entry by entry."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.journal import EpisodeKey, StoredEpisodes, read_episodes
from bestman_bt.evaluation.result import RunResult
from bestman_bt.registry import suggestion


@dataclass(frozen=True)
class FinishedEntry:
    """One entry of an evaluation. ``settings``: overrides of its task. ``results``: in the order of their seeds."""

    name: str
    task: str
    results: tuple[RunResult, ...]
    settings: Mapping[str, str] = field(default_factory=dict)


def read_entries(given: str) -> list[FinishedEntry]:
    """Return the entries of ``FOLDER``, or the one of ``FOLDER:ENTRY``.

    Raises ConfigurationError if there is none.
    """
    path, colon, name = given, "", ""
    if not Path(given).is_dir():
        path, colon, name = given.rpartition(":")
    folder = Path(path) if colon else Path(given)
    if not (folder / "summary.json").is_file():
        raise _problem(str(folder), "is not the folder of an evaluation: it has no summary.json")
    try:
        summary = json.loads((folder / "summary.json").read_bytes())
        entries = [
            _entry(entry, summary["code"], read_episodes(folder / "episodes.jsonl")) for entry in summary["entries"]
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise _problem(str(folder), f"cannot be read as an evaluation: {error!r}") from error
    if not colon:
        return entries
    named = [entry for entry in entries if entry.name == name]
    if not named:
        known = [entry.name for entry in entries]
        raise _problem(given, f"the evaluation has no entry {name!r}; {suggestion(name, known)}")
    return named


def _entry(summary: Mapping[str, Any], code: str, episodes: StoredEpisodes) -> FinishedEntry:
    """Return the episodes of the summary's code version, or, if they were kept, of the version that
    ran each seed last.
    """
    config, first, keys = summary["config"], summary["first_seed"], list[EpisodeKey]()
    for seed in range(first, first + summary["asked_episodes"]):
        if codes := episodes.codes(config, seed):
            keys.append(EpisodeKey(config, seed, code if code in codes else codes[-1]))
    results = tuple(result for _, result in episodes.read(keys))
    return FinishedEntry(summary["name"], summary["task"], results, summary["settings"])


def _problem(source: str, message: str) -> ConfigurationError:
    return ConfigurationError([Problem(source, None, "", message)])
