"""A finished evaluation in a folder, whose episodes were never run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.code_version import code_fingerprint, config_fingerprint
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.journal import EpisodeKey, Journal
from bestman_bt.evaluation.suite import EntryConfig, Suite, SuiteEntry
from tests.evaluation.test_summary import result


def finished_evaluation(folder: Path, entries: Mapping[str, str], episodes: int = 6, first_seed: int = 5) -> None:
    """``entries``: name → its setting. Every episode succeeds, with a place error that is its seed in millimetres."""
    made = []
    for name, setting in entries.items():
        config = load_run("fetch_cup", seed=first_seed, settings=[setting])
        made.append(SuiteEntry(name, config, episodes, EntryConfig(settings=(setting,))))
    with Journal(folder / "episodes.jsonl") as journal:
        for entry in made:
            for seed in range(first_seed, first_seed + episodes):
                key = EpisodeKey(config_fingerprint(entry.config), seed, code_fingerprint())
                journal.add(key, "", result(seed))
    with Evaluation(Suite("mine", tuple(made)), folder) as evaluation:
        (folder / "summary.json").write_text(json.dumps(evaluation.document()))
