"""Many episodes of one task, one process per job; the result does not depend on the number of jobs."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from bestman_bt.configuration import RunConfig
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.evaluation.result import FailureReport, Outcome, RunResult
from bestman_bt.evaluation.run_folder import make_run_folder
from bestman_bt.evaluation.summary import summarize
from bestman_bt.evaluation.versions import versions


def run_batch(
    config: RunConfig,
    episodes: int,
    jobs: int = 1,
    folder: Path | None = None,
    on_result: Callable[[RunResult], None] | None = None,
) -> dict[str, Any]:
    """Run seeds ``config.seed`` … ``config.seed + episodes - 1`` and summarise them.

    ``folder``: each run gets its folder there. ``on_result``: told of each result as it comes, in the order of seeds.
    Ctrl-C, or an episode that somebody stops, ends the batch: the document then has only the episodes that were done.
    Everything that can be checked is checked before the first episode; raises as ``prepare_episode``.
    """
    prepare_episode(config)
    configs = [replace(config, seed=config.seed + i) for i in range(episodes)]
    start = time.perf_counter()
    results: list[RunResult] = []
    with suppress(KeyboardInterrupt), closing(_run_all(configs, jobs, folder)) as running:
        for result in running:
            if result.outcome is Outcome.CANCELLED:
                break
            results.append(result)
            if on_result is not None:
                on_result(result)
    return summarize(config.name, config.seed, results, time.perf_counter() - start)


def _run_all(configs: Sequence[RunConfig], jobs: int, folder: Path | None) -> Generator[RunResult, None, None]:
    if jobs == 1:
        for config in configs:
            yield _run(config, folder)
        return
    # Each worker is a fresh interpreter with one thread: pybullet and OMPL keep state in the process.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_leave_interrupts_to_the_parent) as pool:
        try:
            for future in [pool.submit(_run, config, folder) for config in configs]:
                yield future.result()
        except (GeneratorExit, KeyboardInterrupt):
            for worker in set(multiprocessing.active_children()) - others:
                worker.kill()  # SIGTERM would only cancel the episode that it runs
            raise


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _run(config: RunConfig, folder: Path | None) -> RunResult:
    run_folder = make_run_folder(config, folder) if folder is not None else None
    start = time.perf_counter()
    try:
        return run_episode(config, run_folder)
    except Exception as error:  # noqa: BLE001 - one episode that breaks is a failed episode, not the end of the batch
        result = RunResult(
            task=config.name,
            seed=config.seed,
            success=False,
            outcome=Outcome.ERROR,
            tree_status="IDLE",
            predicate=None,
            failure=FailureReport("", "error", f"{type(error).__name__}: {error}"),
            audit={},
            metrics={},
            sim_time_s=0.0,
            wall_time_s=round(time.perf_counter() - start, 3),
            versions=versions(),
        )
    if run_folder is not None:
        result.write(run_folder / "result.json")
    return result
