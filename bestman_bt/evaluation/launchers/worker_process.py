"""A worker process: a fresh interpreter that runs one episode after the other, and whose crash costs only its own.

Light to import: the processes that only pass episodes on never load what runs them.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bestman_bt.evaluation.launchers.launcher import EpisodeRequest

_PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)  # interrupts are the parent's
sys.path[:] = sys.argv[2:]
from bestman_bt.evaluation.launchers.worker_process import serve
serve(int(sys.argv[1]))
"""
_KILLED = (-signal.SIGKILL, -signal.SIGTERM)
"""Exit codes of a process that was ended from outside: by a person, the kernel's memory killer or a scheduler."""


@dataclass(frozen=True)
class Answer:
    """What became of an episode; exactly one of the texts or ``result`` is not empty.

    ``result``: the pickled ``RunResult``. ``crashed``: the episode ended its process, or hung. ``lost``: the worker was
    ended from outside, which says nothing of the episode. ``refused``: the worker cannot run it. ``seconds``: of wall
    time, until the worker was gone.
    """

    result: bytes = b""
    crashed: str = ""
    lost: str = ""
    refused: str = ""
    seconds: float = 0.0


class WorkerProcess:
    """One process, which runs what is given to it. ``alive``: whether it can take another episode."""

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        # PyBullet and OMPL keep state in the process, so workers are fresh interpreters, with one thread each.
        environment = {"OPENBLAS_NUM_THREADS": "1", **os.environ}
        command = [sys.executable, "-c", _PROGRAM, str(theirs.fileno()), *sys.path]
        self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()], env=environment)
        theirs.close()
        self.alive = True
        self._ready = False
        self._began = 0.0
        self._limit = 0.0

    def give(self, request: bytes, wall_limit: float) -> None:
        """Let it run a pickled ``EpisodeRequest``; after ``wall_limit`` seconds the episode is taken to hang."""
        self._began, self._limit = time.perf_counter(), wall_limit
        with suppress(ConnectionError):  # its end is told by ``answer``
            self.connection.send_bytes(request)

    def answer(self, timeout: float = 0.0) -> Answer | None:
        """Return what became of the episode, once that is known. Raises RuntimeError if the worker cannot start."""
        try:
            if self.connection.poll(timeout):
                message = self.connection.recv()
                if isinstance(message, Answer):
                    return message
                self._ready, self._began = True, time.perf_counter()
                return None
        except (EOFError, ConnectionError) as error:
            code = self._process.wait()
            self.kill()
            if code in _KILLED:
                return Answer(lost=f"its worker was ended by signal {-code}")
            if not self._ready:
                raise RuntimeError("a worker process cannot start; its error is above") from error
            return Answer(crashed=f"the process ended with code {code}", seconds=self._passed)
        if not self._ready or self._passed <= self._limit:
            return None
        self.kill()
        return Answer(crashed=f"given up after {self._passed:.0f} s of wall time", seconds=self._passed)

    @property
    def _passed(self) -> float:
        return time.perf_counter() - self._began

    def kill(self) -> None:
        """End it, and the episode that it runs."""
        self.alive = False
        self._process.kill()  # SIGTERM would only cancel the episode that it runs
        self._process.wait()
        self.connection.close()


def serve(descriptor: int) -> None:
    """Run the episodes that come through the connection, until its other end is closed."""
    connection = Connection(descriptor)
    threading.Thread(target=_end_with_the_parent, args=(descriptor,), daemon=True).start()
    connection.send("ready")
    while True:
        try:
            request = connection.recv_bytes()
        except EOFError:
            return
        connection.send(_answer(request))


def _answer(request: bytes) -> Answer:
    asked: EpisodeRequest = pickle.loads(request)  # noqa: S301 - from the process that has started this one
    why = asked.why_not_here()
    return Answer(refused=why) if why else Answer(result=pickle.dumps(asked.run()))


def _end_with_the_parent(descriptor: int) -> None:
    """An episode whose result is no longer needed is not run to its end."""
    hung_up = select.poll()
    hung_up.register(descriptor, select.POLLRDHUP)
    hung_up.poll()
    os._exit(1)
