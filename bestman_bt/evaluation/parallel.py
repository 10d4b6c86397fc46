"""Episodes in worker processes: each worker is a fresh interpreter, and a crash costs only its own episode."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from pathlib import Path

from behaviours.failure import NodeFailure
from bestman_bt.configuration.run import RunConfig
from bestman_bt.engine.own_files import in_words
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.run_folder import make_run_folder
from bestman_bt.evaluation.versions import versions

WALL_LIMIT = 3600.0
"""Seconds of wall time after which an episode is taken to hang."""


def run_episodes(
    configs: Sequence[RunConfig], jobs: int = 1, folder: Path | None = None, wall_limit: float = WALL_LIMIT
) -> Generator[tuple[int, RunResult]]:
    """Run each configuration; yields its index and result as soon as it is done.

    ``folder``: parent of the run folders. One job runs in this process, more in as many workers; there, an episode that
    kills its process, or takes longer than ``wall_limit`` seconds, is recorded as an error. Closing the generator kills
    the workers. Raises RuntimeError if a worker cannot start.
    """
    if jobs == 1:
        for index, config in enumerate(configs):
            yield index, run_or_tell(config, folder)
        return
    # pybullet and OMPL keep state in the process, so workers are fresh interpreters, with one thread each.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    waiting = list(reversed(range(len(configs))))
    workers: list[_Worker] = []
    try:
        while waiting or workers:
            while waiting and len(workers) < jobs:
                workers.append(_Worker())
                workers[-1].give(index := waiting.pop(), configs[index], folder)
            wait([worker.connection for worker in workers], timeout=1.0)
            for worker in list(workers):
                result = worker.outcome(configs[worker.index], wall_limit)
                if result is None:
                    continue
                done = worker.index
                if worker.alive and waiting:
                    worker.give(index := waiting.pop(), configs[index], folder)
                else:
                    worker.kill()
                    workers.remove(worker)
                yield done, result
    finally:
        for worker in workers:
            worker.kill()


def run_or_tell(config: RunConfig, folder: Path | None) -> RunResult:
    """Return the result of one run; an exception gives a result with the error."""
    run_folder = make_run_folder(config, folder) if folder is not None else None
    start = time.perf_counter()
    try:
        with _without_warnings():  # who made the suite has prepared it, and was told them then
            setup = prepare_episode(config)
        return run_episode(setup, run_folder)
    except Exception as error:  # noqa: BLE001 - one episode that breaks is a failed episode, not the end of the batch
        result = _broken(config, in_words(error), time.perf_counter() - start)
    if run_folder is not None:
        result.write(run_folder / "result.json")
    return result


@contextmanager
def _without_warnings() -> Iterator[None]:
    disabled = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)


class _Worker:
    """One process, which runs what comes through its connection; ``index``: of the configuration that it has now."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,))
        self._process.start()
        theirs.close()
        self.alive = True
        self.index = -1
        self._ready = False
        self._began = 0.0

    def give(self, index: int, config: RunConfig, folder: Path | None) -> None:
        self.index, self._began = index, time.perf_counter()
        self.connection.send((config, folder))

    def outcome(self, config: RunConfig, wall_limit: float) -> RunResult | None:
        """Return the result, once there is one; afterwards ``alive`` tells whether the worker can take the next."""
        passed = time.perf_counter() - self._began
        try:
            if self.connection.poll():
                message = self.connection.recv()
                if isinstance(message, RunResult):
                    return message
                self._ready, self._began = True, time.perf_counter()
                return None
        except (EOFError, ConnectionError) as error:
            self.kill()
            if not self._ready:
                raise RuntimeError("a worker process cannot start; its error is above") from error
            return _broken(config, f"the process ended with code {self._process.exitcode}", passed)
        if not self._ready or passed <= wall_limit:
            return None
        self.kill()
        return _broken(config, f"given up after {passed:.0f} s of wall time", passed)

    def kill(self) -> None:
        self.alive = False
        self._process.kill()  # SIGTERM would only cancel the episode that it runs
        self._process.join()
        self.connection.close()


def _serve(connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # interrupts are the parent's
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    connection.send("ready")
    while True:
        try:
            config, folder = connection.recv()
        except EOFError:
            return
        connection.send(run_or_tell(config, folder))


def _end_with_the_parent() -> None:
    """An episode whose result is no longer needed is not run to its end."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _broken(config: RunConfig, why: str, wall_time: float) -> RunResult:
    return RunResult(
        task=config.name,
        seed=config.seed,
        success=False,
        outcome=Outcome.ERROR,
        tree_status="IDLE",
        predicate=None,
        failure=NodeFailure("", "error", why),
        audit={},
        metrics={},
        sim_time_s=0.0,
        wall_time_s=round(wall_time, 3),
        versions=versions(),
    )
