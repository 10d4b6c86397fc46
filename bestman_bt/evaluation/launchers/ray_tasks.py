"""Episodes as tasks of a Ray cluster: of this machine, or of many."""

from __future__ import annotations

import atexit
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from bestman_bt.configuration.data import data_root
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, Launcher, LaunchOptions
from bestman_bt.evaluation.launchers.remote_events import EventReceiver
from bestman_bt.evaluation.launchers.worker_process import (
    UNPACKING,
    EpisodeAnswer,
    LauncherLostError,
    code_here,
    run_in_own_process,
)
from bestman_bt.evaluation.result import RunResult
from bestman_bt.extras import require_extra

HEAD_PATIENCE = 10.0
"""Seconds without an answer after which the head of the cluster counts as lost."""
_ADDRESS = re.compile(r"auto|(ray://)?[^\s:/]+:\d{1,5}|(ray://)?\[[0-9a-fA-F:]+\]:\d{1,5}")
SHUTDOWN_PATIENCE = 10.0
"""Time limit for a cluster to close the connection, seconds."""


class RayTasks(Launcher):
    """Distributes episodes with Ray. Each runs in a separate process below its task, so that a crash of the episode is
    not mistaken for the loss of a worker or node; only after such a loss is it run again.

    Without an address, Ray is started on this machine, on loopback. On a cluster, the code of a checkout is uploaded;
    an installed package must also be installed there. Every node must have the code of the evaluation.
    """

    def __init__(self, options: LaunchOptions | None = None) -> None:
        super().__init__(options)
        require_extra("--launcher ray", "ray")
        if self.options.address and not _ADDRESS.fullmatch(self.options.address):
            raise _problem(f"should be HOST:PORT of the head, such as 10.0.0.7:6379, got {self.options.address!r}")
        self._waiting: deque[int] = deque()
        self._pending: dict[Any, int] = {}
        self._ray: Any = None
        self._task: Any = None
        self._events: EventReceiver | None = None
        self._unseen: list[str] = []

    def submit(self, requests: Sequence[EpisodeRequest]) -> None:
        """Queue further episodes; the first ones connect to the cluster."""
        if self._ray is None and requests:
            self._start(requests[0].code)
        self._waiting += self.record(requests)

    def results(self) -> Iterator[tuple[int, RunResult]]:
        """Yield each place with its result. Raises LauncherLostError if the head no longer responds."""
        heard = time.monotonic()
        while self._waiting or self._pending:
            if _reachable(self._head):  # whatever is asked of a head that is lost never returns
                heard = time.monotonic()
                room = self.options.jobs or 2 * int(self._ray.cluster_resources().get("CPU", 1))
                while self._waiting and len(self._pending) < room:
                    self._give(self._waiting.popleft())
            elif time.monotonic() - heard > HEAD_PATIENCE:
                raise LauncherLostError(
                    f"the head of the Ray cluster at {self._head} no longer answers; what has finished is kept: "
                    "start a head again and repeat the command"
                )
            finished, _ = self._ray.wait(list(self._pending), timeout=1.0)
            for reference in finished:
                place = self._pending.pop(reference)
                result = self.take(place, self._answer(reference))
                if result is not None:
                    yield place, result
                elif place not in self.given_up:
                    self._waiting.append(place)

    @property
    def notes(self) -> list[str]:
        """Remarks on the execution, also on episodes that no monitor shows."""
        return super().notes + self._unseen

    def cancel(self) -> None:
        """Disconnect, which ends the running tasks."""
        self._waiting.clear()
        self._pending.clear()
        if self._events is not None:
            self._events.close()
            self._events = None
        if self._ray is not None:
            # It waits for a head that may be lost.
            closing = threading.Thread(target=self._ray.shutdown, daemon=True)
            closing.start()
            closing.join(SHUTDOWN_PATIENCE)
            if closing.is_alive():
                atexit.unregister(self._ray.shutdown)
            self._ray = None

    def _start(self, code: str) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        address, asked = self.options.address, dict[str, Any]()
        if address:
            asked = {"address": address}
            where = address.removeprefix("ray://")
            if where != "auto" and not _reachable(where):
                raise _problem(f"{address} does not answer; is its head running ('ray start --head'), the port open?")
            if shipped := _code_of_checkout():
                asked["runtime_env"] = {"working_dir": shipped}
        else:
            # Whatever the system, what Ray calls so keeps it on loopback.
            os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
            # Otherwise Ray would look for a running one.
            asked = {"address": "local", "num_cpus": self.options.jobs or os.cpu_count(), "include_dashboard": False}
        ray = import_module("ray")
        try:
            ray.init(log_to_driver=False, logging_level="error", **asked)
        except (ConnectionError, RuntimeError, ValueError) as error:  # unreachable, another Python or Ray
            why = " ".join(str(error).split())
            remedy = "; use the same versions on both" if "Version mismatch" in why else ""
            raise _problem(f"{address or 'a Ray of this machine'} cannot be used: {why}{remedy}") from error
        self._ray = ray
        self._head = str(ray.get_runtime_context().gcs_address)
        if self.options.monitor:
            try:
                self._events = EventReceiver(ray.util.get_node_ip_address())
            except OSError as error:  # the address that the cluster sees need not be one of this machine
                self._unseen.append(f"episodes of other machines are not shown: {error.strerror}")
        self._task = ray.remote(num_cpus=1, max_retries=0)(run_in_own_process)
        try:
            self._refuse_other_code(code)
        except ConfigurationError:
            self.cancel()
            raise

    def _refuse_other_code(self, code: str) -> None:
        problems = self._problems_of_nodes(code)
        deadline = time.monotonic() + UNPACKING
        while problems:
            if time.monotonic() > deadline:
                raise ConfigurationError(Problem("--launcher ray", None, "", why) for why in problems)
            time.sleep(1.0)
            problems = self._problems_of_nodes(code)

    def _problems_of_nodes(self, code: str) -> list[str]:
        """Return for each node that cannot run episodes of the code why not."""
        affinity = import_module("ray.util.scheduling_strategies").NodeAffinitySchedulingStrategy
        asks = self._ray.remote(num_cpus=0, max_retries=0)(code_here)
        nodes = {node["NodeID"]: node["NodeManagerAddress"] for node in self._ray.nodes() if node["Alive"]}
        asked = {node: asks.options(scheduling_strategy=affinity(node, soft=False)).remote() for node in nodes}
        problems = []
        for node, reference in asked.items():
            try:
                there, versions = self._ray.get(reference)
            except self._ray.exceptions.RayError as error:
                reason = _last_line(error)
                if isinstance(error, self._ray.exceptions.RayTaskError):  # it was reached, and could not import
                    why = f"cannot run bestman-bt: {reason}; install the same version there"
                else:
                    why = f"has not answered ({type(error).__name__}: {reason}); it may have been lost or not be ready"
                problems.append(f"node {nodes[node]} {why}; if it has just joined, repeat the command")
                continue
            if there != code:
                why = f"node {nodes[node]} has other code ({there}, here {code}; there {versions})"
                problems.append(f"{why}; install the same version of bestman-bt and of these packages")
        return problems

    def _give(self, place: int) -> None:
        request = replace(self.requests[place], events=None if self._events is None else self._events.address)
        reference = self._task.remote(request.pickled(), request.wall_limit, str(Path.cwd()))
        self._pending[reference] = place

    def _answer(self, reference: Any) -> EpisodeAnswer:
        errors = self._ray.exceptions
        losses = (
            errors.WorkerCrashedError,
            errors.NodeDiedError,
            errors.LocalRayletDiedError,
            errors.ObjectLostError,
            errors.OutOfMemoryError,
        )
        try:
            answer: EpisodeAnswer = self._ray.get(reference)
        except losses as error:
            return EpisodeAnswer(lost=f"its Ray worker or node was lost ({type(error).__name__})")
        except (errors.RayTaskError, errors.RuntimeEnvSetupError) as error:
            reason = _last_line(error)
            # Ray reports a function that cannot be imported as a RuntimeError.
            if isinstance(error, errors.RayTaskError) and not isinstance(error.cause, (ImportError, RuntimeError)):
                return EpisodeAnswer(lost=f"its Ray task failed ({reason})", by_machine=True)
            return EpisodeAnswer(
                refused=f"a node cannot run episodes: {reason}; what has finished is kept: repeat the command"
            )
        return answer


def _last_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


def _reachable(address: str) -> bool:
    host, _, port = address.rpartition(":")
    try:
        with socket.create_connection((host, int(port)), timeout=3.0):
            return True
    except (OSError, ValueError):
        return False


def _code_of_checkout() -> str:
    """Return a folder with the content of a wheel, built now; empty outside a checkout.

    Ray would install a wheel with all that it requires, again on each node; the folder contains only the code.
    """
    if not (data_root() / "pyproject.toml").is_file():
        return ""
    folder = Path(tempfile.mkdtemp(prefix="bestman_bt_wheel_"))
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder / "wheel")]
    done = subprocess.run(build, cwd=data_root(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise _problem(f"no wheel can be built from {data_root()}: {done.stderr.strip()}")
    (wheel,) = (folder / "wheel").iterdir()
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "code")
    return str(folder / "code")


def _problem(why: str) -> ConfigurationError:
    return ConfigurationError([Problem("--address", None, "", why)])
