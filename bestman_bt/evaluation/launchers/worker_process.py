"""A worker process: a separate interpreter that runs episodes in sequence; a crash affects only the current one.

The module imports quickly: processes that only forward episodes do not load the packages that run them.
"""

from __future__ import annotations

import os
import pickle
import platform
import select
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory

from bestman_bt.errors import Error

_PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)  # interrupts are the parent's
sys.path[:] = sys.argv[2:]
from bestman_bt.evaluation.launchers.worker_process import serve
serve(int(sys.argv[1]))
"""
_ALONE = 113
"""Exit code of a worker whose parent has gone."""
_ENDED = {
    -signal.SIGKILL: "its worker was ended by signal 9, often for lack of memory, of which fewer --jobs need less",
    -signal.SIGTERM: "its worker was ended by signal 15",
    _ALONE: "its worker was left alone",
}
"""Exit codes not caused by the episode: a person, the kernel's memory killer or a scheduler ended the worker."""


UNPACKING = 10.0
"""Seconds for which the code may be missing or incomplete: a raylet that joins unpacks it again into the folder of
those already running on its machine.
"""


class LauncherLostError(Error):
    """Raised if the workers are lost or refuse the episodes; finished episodes are kept."""

    code = "launcher_lost"


@dataclass(frozen=True)
class EpisodeAnswer:
    """The outcome of an episode in a worker; exactly one of the texts or ``result`` is not empty.

    ``result``: the pickled ``RunResult``. ``crashed``: the episode ended its process, or hung. ``lost``: the worker was
    killed from outside, independently of the episode. ``refused``: the worker cannot run it. ``seconds``: of wall time,
    until the worker was gone. ``by_machine``: no episode could have been run, as on a full disk.
    """

    result: bytes = b""
    crashed: str = ""
    lost: str = ""
    refused: str = ""
    seconds: float = 0.0
    by_machine: bool = False


class WorkerProcess:
    """One worker process, which runs the episodes passed to it. ``alive``: whether it can take another episode."""

    def __init__(self, folder: str | None = None) -> None:
        """Start it, with ``folder`` as its working directory; None: this process's."""
        self.connection, theirs = Pipe()
        # PyBullet and OMPL keep state in the process, so workers are fresh interpreters, with one thread each.
        self._temporary = TemporaryDirectory(prefix="bestman_bt_worker_", ignore_cleanup_errors=True)
        environment = {"OPENBLAS_NUM_THREADS": "1", **os.environ, "TMPDIR": self._temporary.name}
        command = [sys.executable, "-c", _PROGRAM, str(theirs.fileno()), *sys.path]
        self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()], env=environment, cwd=folder)
        theirs.close()
        self.alive = True
        self._ready = False
        self._began = 0.0
        self._limit = 0.0

    def give(self, request: bytes, wall_limit: float) -> None:
        """Run a pickled ``EpisodeRequest``; after ``wall_limit`` seconds it counts as hanging."""
        self._began, self._limit = time.perf_counter(), wall_limit
        with suppress(ConnectionError):  # ``answer`` reports its end
            self.connection.send_bytes(request)

    def answer(self, timeout: float = 0.0) -> EpisodeAnswer | None:
        """Return the outcome of the episode, or None if it has not ended after ``timeout`` seconds. Raises RuntimeError
        if the worker cannot start."""
        try:
            if self.connection.poll(timeout):
                message = self.connection.recv()
                if isinstance(message, EpisodeAnswer):
                    if message.lost:
                        self.kill()  # the next episode gets a new one
                    return message
                self._ready, self._began = True, time.perf_counter()
                return None
        except (EOFError, ConnectionError) as error:
            code = self._process.wait()
            self.kill()
            if code in _ENDED:
                return EpisodeAnswer(lost=_ENDED[code])
            if not self._ready:
                raise RuntimeError("a worker process cannot start; its error is above") from error
            return EpisodeAnswer(crashed=f"the process ended with code {code}", seconds=self._passed)
        if not self._ready or self._passed <= self._limit:
            return None
        self.kill()
        return EpisodeAnswer(crashed=f"given up after {self._passed:.0f} s of wall time", seconds=self._passed)

    @property
    def _passed(self) -> float:
        return time.perf_counter() - self._began

    def kill(self) -> None:
        """Kill the worker and its episode; its temporary files are removed."""
        self.alive = False
        self._process.kill()  # SIGTERM would only cancel the episode that it runs
        self._process.wait()
        self.connection.close()
        self._temporary.cleanup()


_own: list[WorkerProcess] = []
"""The worker of this process, kept for the next episode."""


def run_in_own_process(request: bytes, wall_limit: float, folder: str) -> EpisodeAnswer:
    """Run a pickled ``EpisodeRequest`` in a worker of this process, in ``folder`` if it exists, and wait for it.

    A worker that cannot start, as on a full disk, counts as lost.
    """
    try:
        if not _own:
            _own.append(WorkerProcess(folder if Path(folder).is_dir() else None))
        _own[0].give(request, wall_limit)
        while (answer := _own[0].answer(1.0)) is None:
            pass
    except (OSError, RuntimeError) as error:
        time.sleep(UNPACKING)
        why = error.strerror if isinstance(error, OSError) else error
        answer = EpisodeAnswer(lost=f"no worker starts on {platform.node()}: {why}", by_machine=True)
    if _own and not _own[0].alive:
        _own.clear()
    return answer


def code_here() -> tuple[str, str]:
    """Return the fingerprint of this process's code, and the versions of the packages in it as text."""
    from bestman_bt.evaluation.code_version import code_fingerprint
    from bestman_bt.evaluation.versions import versions

    return code_fingerprint(), ", ".join(f"{name} {version}" for name, version in versions().items())


def serve(descriptor: int) -> None:
    """Run the episodes received through the connection until its other end is closed."""
    from bestman_bt.evaluation.code_version import code_on_disk

    connection, code = Connection(descriptor), code_on_disk()
    threading.Thread(target=_end_with_the_parent, args=(descriptor,), daemon=True).start()
    import_module("bestman_bt.evaluation.launchers.launcher")  # takes seconds, which are not the first episode's
    connection.send("ready")
    while True:
        try:
            request = connection.recv_bytes()
        except EOFError:
            return
        connection.send(_answer(request, code))


def _answer(request: bytes, code: frozenset[tuple[str, int, int]]) -> EpisodeAnswer:
    from bestman_bt.evaluation.code_version import code_on_disk

    try:
        asked = pickle.loads(request)  # noqa: S301 - from the process that has started this one
        deadline = time.monotonic() + UNPACKING
        while why := asked.refusal_here():
            if time.monotonic() > deadline:
                return EpisodeAnswer(refused=why)
            time.sleep(0.5)
        result = asked.run()
        if asked.code and code_on_disk() != code:  # whatever the result, it is not known which code it is of
            return EpisodeAnswer(lost="files of the code were replaced while it ran")
        return EpisodeAnswer(result=pickle.dumps(result))
    except LauncherLostError as error:
        return EpisodeAnswer(refused=str(error))
    except Exception as error:  # noqa: BLE001 - ``run`` catches those of the episode: this one is the worker's
        return EpisodeAnswer(lost=f"its worker failed ({type(error).__name__}: {error})", by_machine=True)


def _end_with_the_parent(descriptor: int) -> None:
    """End this process when its parent closes the connection: the result is no longer needed."""
    hung_up = select.poll()
    hung_up.register(descriptor, select.POLLRDHUP)
    hung_up.poll()
    os._exit(_ALONE)
