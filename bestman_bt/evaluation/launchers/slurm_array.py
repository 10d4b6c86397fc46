"""Episodes as an array job of Slurm, written and submitted by submitit."""

from __future__ import annotations

import base64
import getpass
import os
import pickle
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, Launcher, LaunchOptions
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer, LauncherLostError, run_in_own_process
from bestman_bt.evaluation.result import RunResult
from bestman_bt.extras import require_extra

TASKS = 16
"""Default number of tasks of the array job."""
TIME_LIMIT = 24 * 60
"""Time limit of a task, minutes; another task runs its remaining episodes."""
POLL = 2.0
"""Seconds between two checks for finished episodes."""
MOST_FRUITLESS = 3
"""Number of successive tasks without a finished episode after which no further task is submitted."""


class SlurmArray(Launcher):
    """Runs the episodes as a Slurm job array: each task runs its share in sequence and appends the results to its file.
    Episodes missed by a finished task are submitted again.

    All machines must have the folder, the code and the user's files under the same paths. ``cluster``: submitit's
    executor; ``local`` runs the tasks as processes of this machine.
    """

    def __init__(self, options: LaunchOptions | None = None, cluster: str = "slurm") -> None:
        super().__init__(options)
        require_extra("--launcher slurm", "slurm")
        if self.options.address:
            raise _problem("--address", "is not for slurm: sbatch knows its cluster (SLURM_CONF)")
        if cluster == "slurm" and not shutil.which("sbatch"):
            raise _problem("--launcher slurm", "sbatch was not found: run the command where jobs are submitted")
        self._cluster = cluster
        self._parts: list[_Part] = []
        self._executor: Any = None
        self._fruitless = 0

    def submit(self, requests: Sequence[EpisodeRequest]) -> None:
        """Submit an array job that runs further episodes."""
        places = list(self.record(requests))
        tasks = min(self.options.jobs or TASKS, len(places))
        self._submit([places[number::tasks] for number in range(tasks)])

    def results(self) -> Iterator[tuple[int, RunResult]]:
        """Yield each place with its result. Raises LauncherLostError if tasks end before there is any."""
        yielded: set[int] = set()
        while self._parts:
            running = self._running()
            again: list[list[int]] = []
            for part in list(self._parts):
                answers = part.read()
                if part.job.job_id not in running:
                    self._parts.remove(part)
                    answers += part.read()
                    self._fruitless = self._fruitless + 1 if part.left and not part.offset else 0
                    if part.left:  # the first of them was running
                        answers.append((part.left.pop(0), EpisodeAnswer(lost="its task of Slurm was lost")))
                    again.append(part.left)
                for place, answer in answers:
                    result = self.take(place, answer)
                    if result is None:
                        again += [[place]] * (place not in self.given_up)
                    elif place not in yielded:
                        yielded.add(place)
                        yield place, result
            if self._fruitless >= MOST_FRUITLESS and not self.any_ended:
                raise LauncherLostError(
                    f"{self._fruitless} tasks of Slurm ended without one finished episode; what they wrote is in "
                    f"{self._executor.folder}"
                )
            self._submit([places for places in again if places])
            if self._parts:
                time.sleep(POLL)

    def cancel(self) -> None:
        """Cancel the tasks that wait or run."""
        for part in self._parts:
            part.job.cancel(check=False)
        self._parts.clear()

    def _submit(self, shares: Sequence[list[int]]) -> None:
        if not shares:
            return
        if self._executor is None:
            folder = self.options.folder or Path(tempfile.mkdtemp(prefix="bestman_bt_slurm_"))
            submitit = import_module("submitit")
            self._executor = submitit.AutoExecutor((folder / "slurm").resolve(), cluster=self._cluster)
            self._executor.update_parameters(name="bestman-bt", timeout_min=TIME_LIMIT, cpus_per_task=1)
        files = [self._new_file() for _ in shares]
        sent = [[(place, self._sent(place)) for place in places] for places in shares]
        names, here = [str(file) for file in files], [str(Path.cwd())] * len(files)
        try:
            jobs = self._executor.map_array(run_share, sent, names, here)
        except RuntimeError as error:  # submitit's FailedJobError is one
            raise _problem("--launcher slurm", f"sbatch has refused the job: {error}") from error
        self._parts += [_Part(*one) for one in zip(jobs, files, shares, strict=True)]

    def _sent(self, place: int) -> tuple[bytes, float]:
        request = self.requests[place]
        return request.pickled(), request.wall_limit

    def _new_file(self) -> Path:
        self._executor.folder.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(suffix=".results", dir=self._executor.folder)
        os.close(descriptor)
        return Path(name)

    def _running(self) -> set[str]:
        """Return waiting and running tasks; from the queue, because not every Slurm keeps accounts."""
        if self._cluster != "slurm":
            return {part.job.job_id for part in self._parts if not part.job.done()}
        asked = ["squeue", "--noheader", "--array", "--user", getpass.getuser(), "--format", "%i"]
        done = subprocess.run(asked, capture_output=True, text=True, check=False)
        if done.returncode:  # the controller is away for a while: everything may still run
            return {part.job.job_id for part in self._parts}
        return set(done.stdout.split())


@dataclass
class _Part:
    """A task of the array: its file, and the episodes without an answer so far, in their order."""

    job: Any
    file: Path
    left: list[int]
    offset: int = field(default=0, init=False)

    def read(self) -> list[tuple[int, EpisodeAnswer]]:
        """Return the answers since the last call."""
        with self.file.open("rb") as file:
            file.seek(self.offset)
            whole, newline, _ = file.read().rpartition(b"\n")
        self.offset += len(whole + newline)
        answers = [_parsed(line) for line in whole.split(b"\n")] if whole else []
        answered = {place for place, _ in answers}
        self.left = [place for place in self.left if place not in answered]
        return answers


def run_share(episodes: Sequence[tuple[int, tuple[bytes, float]]], file: str, folder: str) -> None:
    """Run the episodes of a task, except those that it had finished before Slurm restarted it."""
    whole, newline, torn = Path(file).read_bytes().rpartition(b"\n")
    if torn:  # the task was killed while it wrote
        os.truncate(file, len(whole + newline))
    finished = {_parsed(line)[0] for line in whole.split(b"\n") if line}
    for place, (request, wall_limit) in episodes:
        if place not in finished:
            answer = run_in_own_process(request, wall_limit, folder)
            with Path(file).open("ab") as results:  # closed, so that other machines see it
                results.write(f"{place} ".encode() + base64.b64encode(pickle.dumps(answer)) + b"\n")


def _parsed(line: bytes) -> tuple[int, EpisodeAnswer]:
    place, _, answer = line.partition(b" ")
    return int(place), pickle.loads(base64.b64decode(answer))  # noqa: S301 - a task of this evaluation wrote it


def _problem(option: str, why: str) -> ConfigurationError:
    return ConfigurationError([Problem(option, None, "", why)])
