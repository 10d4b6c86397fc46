"""Episodes in processes of this machine."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import wait

from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, Launcher, LaunchOptions
from bestman_bt.evaluation.launchers.worker_process import WorkerProcess
from bestman_bt.evaluation.result import RunResult


class LocalProcesses(Launcher):
    """Runs a single job in this process, several jobs in as many worker processes."""

    def __init__(self, options: LaunchOptions | None = None) -> None:
        super().__init__(options)
        self._waiting: deque[int] = deque()
        self._busy: dict[WorkerProcess, int] = {}

    def submit(self, requests: Sequence[EpisodeRequest]) -> None:
        """Queue further episodes; a worker starts with ``results``."""
        self._waiting += self.record(requests)

    def results(self) -> Iterator[tuple[int, RunResult]]:
        """Yield index and result of each episode; a worker ends when no episode is waiting."""
        jobs = self.options.jobs or 1
        while jobs == 1 and self._waiting:
            place = self._waiting.popleft()
            yield place, self.requests[place].run()
        while self._waiting or self._busy:
            while self._waiting and len(self._busy) < jobs:
                self._give(WorkerProcess())
            wait([worker.connection for worker in self._busy], timeout=1.0)
            for worker, place in list(self._busy.items()):
                answer = worker.answer()
                if answer is None:
                    continue
                del self._busy[worker]
                result = self.take(place, answer)
                if result is None and place not in self.given_up:
                    self._waiting.append(place)
                if worker.alive and self._waiting:
                    self._give(worker)
                else:
                    worker.kill()
                if result is not None:
                    yield place, result

    def cancel(self) -> None:
        """Kill the workers and drop the waiting episodes."""
        self._waiting.clear()
        for worker in self._busy:
            worker.kill()
        self._busy.clear()

    def _give(self, worker: WorkerProcess) -> None:
        place = self._waiting.popleft()
        request = self.requests[place]
        self._busy[worker] = place
        # One machine has one code; the evaluation itself notes if that changes meanwhile.
        worker.give(replace(request, code="", files="").pickled(), request.wall_limit)
