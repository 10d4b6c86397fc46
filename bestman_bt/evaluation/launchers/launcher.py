"""The interface between an evaluation and the launcher that runs its episodes."""

from __future__ import annotations

import errno
import logging
import os
import pickle
import platform
import shutil
import time
import warnings
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from behaviours.failure import NodeFailure
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig
from bestman_bt.engine.own_files import describe_error
from bestman_bt.evaluation.code_version import config_fingerprint
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.evaluation.launchers.remote_events import EventAddress, forwarded_events
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer, LauncherLostError, code_here
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.run_folder import make_run_folder
from bestman_bt.evaluation.seed_ranges import ranges
from bestman_bt.evaluation.versions import versions
from bestman_bt.records.writer import RESULT_FILE
from bestman_bt.runtime.resolved_config import ResolvedConfig

WALL_LIMIT = 3600.0
"""Seconds of wall time after which an episode counts as hanging."""
MOST_LOSSES = 3
"""Number of lost workers after which an episode is abandoned without a result; number of abandoned episodes, before any
has ended, after which the launcher is.
"""
MOST_MACHINE_LOSSES = 9
"""Largest number of successive episodes that may be lost because of the machine."""
NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
"""Errors of a full disk, which are not caused by the episode."""
LITTLE_ROOM = 16 << 20
"""Free bytes below which the disk of a run folder counts as full."""


@dataclass(frozen=True)
class EpisodeRequest:
    """One episode for any process that has the same code; picklable.

    ``folder``: parent of its run folder; None saves nothing. ``code``: the fingerprint of the code that must run it,
    empty: any. ``files``: the fingerprint of its configuration with the files that it names, checked along with the
    code. ``wall_limit``: seconds of wall time after which the episode counts as hanging. ``events``: the driver that
    receives its live events, if any.
    """

    config: RunConfig
    folder: Path | None = None
    code: str = ""
    files: str = ""
    wall_limit: float = WALL_LIMIT
    events: EventAddress | None = None

    def pickled(self) -> bytes:
        """Return the pickled request. Raises ConfigurationError if a value of its configuration cannot be pickled."""
        try:
            return pickle.dumps(self)
        except (pickle.PicklingError, TypeError, AttributeError) as error:
            why = f"cannot be sent to another process: {error}; name it as FILE.py:Class, or register it in a plug-in"
            raise ConfigurationError([Problem(f"task {self.config.name}", None, "", why)]) from error

    def refusal_here(self) -> str:
        """Return why this process must not run the episode; empty if it may."""
        if not self.code:
            return ""
        where = f"{platform.node()} (process {os.getpid()})"
        if self.code not in _sound:
            code, packages = code_here()
            if code != self.code:
                return (
                    f"{where} has other code: {code}, here {self.code}; install the same version of bestman-bt and of "
                    f"the packages that decide a run there ({packages})"
                )
            _sound.add(self.code)
        if self.files and not _has_files(self.files, self.config):
            return (
                f"{where} lacks files that the run names, or has different ones: keep your trees, plug-ins "
                "and YAML files where all machines see them under one path"
            )
        return ""

    def run(self) -> RunResult:
        """Return the result of the run; an exception gives a result with the error.

        Raises LauncherLostError if its files cannot be written, as on a full disk.
        """
        start = time.perf_counter()
        try:
            run_folder = make_run_folder(self.config, self.folder) if self.folder is not None else None
            try:
                with _without_warnings():  # shown when the suite was made
                    setup = prepare_episode(self.config)
                with forwarded_events(self.events):
                    return self.run_prepared(setup, run_folder)
            except (Exception, SystemExit) as error:  # whatever a plug-in raises is the error of its episode
                if self.written is not None and _is_disk_full(error, self.written):
                    raise
                result = self.failed_result(describe_error(error), time.perf_counter() - start)
            if run_folder is not None:
                result.write(run_folder / RESULT_FILE)
        except (OSError, ConfigurationError) as error:
            cause = error if isinstance(error, OSError) else error.__cause__
            is_full = isinstance(cause, OSError) and cause.errno in NO_ROOM
            raise LauncherLostError(
                f"{platform.node()} cannot write the files of an episode: {error}; what has finished is kept: repeat "
                f"the command once {'there is room' if is_full else 'they can be written'}"
            ) from error
        return result

    @property
    def written(self) -> Path | None:
        """Return the folder below which the episode writes its files, None if it has none."""
        return self.folder

    def run_prepared(self, setup: ResolvedConfig, run_folder: Path | None) -> RunResult:
        """Run the episode. Raises its errors."""
        return run_episode(setup, run_folder)

    def failed_result(self, why: str, seconds: float = 0.0) -> RunResult:
        """Return the result of an episode that could not be completed, after ``seconds`` of wall time."""
        return RunResult(
            task=self.config.name,
            seed=self.config.seed,
            success=False,
            outcome=Outcome.ERROR,
            tree_status="IDLE",
            predicate=None,
            failure=NodeFailure("", "error", why),
            audit={},
            metrics={},
            sim_time_s=0.0,
            wall_time_s=round(seconds, 3),
            versions=versions(),
        )


@dataclass(frozen=True)
class LaunchOptions:
    """User options of a launcher.

    ``jobs``: number of parallel episodes; None: one on this machine, the capacity of a cluster. ``address``: of the
    cluster; empty: the default one. ``folder``: folder of the evaluation, for the launcher's own files; None: a
    temporary one. ``monitor``: show the episodes in the monitors of this machine, wherever they run.
    """

    jobs: int | None = None
    address: str = ""
    folder: Path | None = None
    monitor: bool = False


class Launcher(ABC):
    """Runs episodes; subclasses define where. Results do not depend on the launcher.

    An episode that ends its own process counts as an error. If its worker was lost independently of it, it is run at
    most three times, then given up without a result, and the others are run; ``notes`` count the repeats by reason.
    """

    def __init__(self, options: LaunchOptions | None = None) -> None:
        """Take the options, without starting anything. Raises ConfigurationError if they cannot be used."""
        self.options = options or LaunchOptions()
        self.requests: list[EpisodeRequest] = []
        self.given_up: dict[int, str] = {}
        """Index of an episode that has lost its worker too often → why."""
        self.any_ended = False
        """Whether an episode has ended, so that the workers can run some."""
        self._lost_in_a_row = 0
        self._losses: Counter[int] = Counter()
        self._repeats: Counter[str] = Counter()

    @abstractmethod
    def submit(self, requests: Sequence[EpisodeRequest]) -> None:
        """Submit further episodes; each is identified by its index in ``requests``. Raises ConfigurationError."""

    @abstractmethod
    def results(self) -> Iterator[tuple[int, RunResult]]:
        """Yield index and result of each submitted episode that is not given up, in the order in which they finish.

        Raises LauncherLostError if the workers are lost, RuntimeError if they cannot start.
        """

    @abstractmethod
    def cancel(self) -> None:
        """Stop running episodes and the workers; idempotent."""

    @property
    def notes(self) -> list[str]:
        """Remarks on the execution for the report, such as how often an episode was run again, and why."""
        return [f"{count} times an episode was run again: {why}" for why, count in self._repeats.items()]

    def record(self, requests: Sequence[EpisodeRequest]) -> range:
        """Add further requests; return their places."""
        before = len(self.requests)
        self.requests += requests
        return range(before, len(self.requests))

    def take(self, place: int, answer: EpisodeAnswer) -> RunResult | None:
        """Return the result that an answer stands for; None: its worker was lost, and the episode must be run again,
        behind those that wait, unless it is ``given_up``.

        Raises LauncherLostError if the worker has refused it, as a node of other code that joined late does, if
        episode after episode is lost by the machine, as where all disks are full, or if episodes are given up before
        any has ended.
        """
        if answer.refused:
            raise LauncherLostError(answer.refused)
        if not answer.lost:
            self.any_ended, self._lost_in_a_row = True, 0
        if answer.result:
            result: RunResult = pickle.loads(answer.result)  # noqa: S301 - from a worker of this evaluation
            return result
        if answer.crashed:
            return self.requests[place].failed_result(answer.crashed, answer.seconds)
        self._losses[place] += 1
        self._lost_in_a_row += 1
        if self._losses[place] < MOST_LOSSES:
            self._repeats[answer.lost] += 1
        else:
            self.given_up[place] = answer.lost
        if answer.by_machine and self._lost_in_a_row >= MOST_MACHINE_LOSSES:
            raise _lost(f"{self._lost_in_a_row} episodes in a row were lost", answer)
        if not self.any_ended and len(self.given_up) >= MOST_LOSSES:
            raise _lost("no episode has ended, each one lost its worker", answer)
        return None

    def without_results(self, names: Mapping[int, str]) -> list[str]:
        """Return a sentence on the seeds without a result of each entry and cause; ``names``: their index → entry."""
        seeds: dict[tuple[str, str], list[int]] = {}
        for place, name in names.items():
            why = f"after {MOST_LOSSES} runs: {self.given_up[place]}" if place in self.given_up else "by the launcher"
            seeds.setdefault((name, why), []).append(self.requests[place].config.seed)
        return [
            f"{name}: no result for {'seed' if len(those) == 1 else 'seeds'} {ranges(sorted(those))} {why}"
            for (name, why), those in seeds.items()
        ]


def _lost(what: str, answer: EpisodeAnswer) -> LauncherLostError:
    return LauncherLostError(
        f"{what}: {answer.lost}; what has finished is kept: repeat the command once the cause is removed"
    )


def _is_disk_full(error: BaseException, folder: Path) -> bool:
    """Return whether the disk of ``folder`` is full; inotify and shared memory answer ENOSPC, too."""
    if not isinstance(error, OSError) or error.errno not in NO_ROOM:
        return False
    return error.errno == errno.EDQUOT or shutil.disk_usage(folder).free < LITTLE_ROOM


_sound: set[str] = set()
"""Fingerprints of code and configurations known to match this process."""


def _has_files(fingerprint: str, config: RunConfig) -> bool:
    """Return whether this process reads the same configuration and files; it looks once for each configuration."""
    if fingerprint not in _sound and config_fingerprint(config) == fingerprint:
        _sound.add(fingerprint)
    return fingerprint in _sound


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
