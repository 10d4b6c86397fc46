"""Many episodes of one task; the result does not depend on the number of jobs."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from bestman_bt.configuration import RunConfig
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.parallel import run_episodes
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.summary import summarize


def run_batch(
    config: RunConfig,
    episodes: int,
    jobs: int = 1,
    folder: Path | None = None,
    on_result: Callable[[RunResult], None] | None = None,
) -> dict[str, Any]:
    """Run seeds ``config.seed`` … ``config.seed + episodes - 1`` and summarise them.

    ``folder``: each run gets its folder there. ``on_result``: told of each result as it comes.
    Ctrl-C, or an episode that somebody stops, ends the batch: the document then has only the episodes that were done.
    Everything that can be checked is checked before the first episode; raises as ``prepare_episode``.
    """
    prepare_episode(config)
    configs = [replace(config, seed=config.seed + i) for i in range(episodes)]
    start = time.perf_counter()
    results: list[RunResult] = []
    with suppress(KeyboardInterrupt), closing(run_episodes(configs, jobs, folder)) as running:
        for _, result in running:
            if result.outcome is Outcome.CANCELLED:
                break
            results.append(result)
            if on_result is not None:
                on_result(result)
    results.sort(key=lambda result: result.seed)
    return summarize(config.name, config.seed, results, time.perf_counter() - start)
