"""What a driver does for each episode, without the episodes: simulated results through the journal, and their shards.

    python -m benchmarks.journal_scale [--episodes 100000] [--shards 64]

Prints processor time per episode, memory, disk, and the time to merge. docs/scale.md has the figures.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.code_version import code_fingerprint, config_fingerprint
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.journal import EpisodeKey, Journal
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.suite import Suite, SuiteEntry
from bestman_bt.evaluation.versions import versions

AUDIT = (*CHEATS, "collisions")
METRICS = {f"metric_{number}_mm": 1.0 + number for number in range(6)}
DURATIONS = {f"{kind}_s": 10.0 for kind in ("drive", "arm", "perception", "planning")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=100_000)
    parser.add_argument("--shards", type=int, default=64)
    asked = parser.parse_args()
    one = RunResult(
        "fetch_cup", 0, True, Outcome.SUCCESS, "SUCCESS", True, None,
        dict.fromkeys(AUDIT, 0), METRICS, 40.0, 8.0, versions(), DURATIONS,
    )  # fmt: skip
    config = load_run("fetch_cup")
    suite = Suite("scale", (SuiteEntry("fetch_cup", config, asked.episodes),))
    keys = EpisodeKey(config_fingerprint(config), 0, code_fingerprint())
    with tempfile.TemporaryDirectory() as name:
        shards = Path(name) / "shards"
        tell("imported", 0.0, asked.episodes)
        began = time.process_time()
        for shard in range(asked.shards):
            with Journal(shards / f"{shard}" / "episodes.jsonl") as journal:
                for seed in range(shard, asked.episodes, asked.shards):
                    journal.add(replace(keys, seed=seed), "commit", replace(one, seed=seed))
        tell("written", began, asked.episodes)
        size = sum(path.stat().st_size for path in shards.rglob("episodes.jsonl"))
        print(f"disk: {size / 1e6:.0f} MB, {size / asked.episodes:.0f} bytes each")
        began = time.process_time()
        with Evaluation(suite, Path(name) / "merged") as evaluation:
            document = evaluation.merge([shards])
        assert document["entries"][0]["succeeded"] == asked.episodes
        assert document["audit_clean"]
        assert not document["contradictions"]
        tell("merged and summarised", began, asked.episodes)


def tell(what: str, began: float, episodes: int) -> None:
    passed = time.process_time() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(
        f"{what}: {passed:.1f} s of processor, {1e3 * passed / episodes:.3f} ms each, {memory:.0f} MB at most",
        flush=True,
    )


if __name__ == "__main__":
    main()
