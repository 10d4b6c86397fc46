"""The control channel: a Unix socket through which others watch, pause, step, halt, set and stop an execution.

One JSON object a line in each direction. Requests: ``{"do": "stop"}``, also ``halt``, ``pause``, ``resume``, ``step``,
``status``, ``subscribe`` and ``{"do": "set", "key": …, "value": …}``. Each is answered by ``{"ok": true, …}`` or
``{"ok": false, "error": …}``; a subscriber also gets ``{"time": …, "changes": [[path, state], …]}`` for each tick that
changed something.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import socket
import socketserver
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bestman_bt.engine import StateChanges, status_name
from bestman_bt.runtime.executor import Executor

MAX_REQUEST = 65536
MAX_BACKLOG = 4096


class ControlError(Exception):
    """A control channel cannot be reached or has refused a request."""


def socket_folder() -> Path:
    """Where the sockets of this user's executors are (mode 0700)."""
    base = os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()
    folder = Path(base) / f"bestman-bt-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        raise ControlError(f"{folder} belongs to another user")
    folder.chmod(0o700)
    return folder


def running_executors() -> list[Path]:
    """The sockets of the executors that run now; sockets that nobody serves any more are removed."""
    alive = []
    for path in sorted(socket_folder().glob("*.sock")):
        try:
            request(path, {"do": "status"}, timeout=2.0)
        except ControlError:
            path.unlink(missing_ok=True)
        else:
            alive.append(path)
    return alive


def request(path: Path, message: dict[str, Any], timeout: float = 5.0) -> dict[str, Any]:
    """Send one request to an executor and return its answer; raises ControlError."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(timeout)
            connection.connect(str(path.resolve()))
            connection.sendall(json.dumps(message).encode() + b"\n")
            line = connection.makefile("rb").readline(16 * MAX_REQUEST)
        answer: dict[str, Any] = json.loads(line)
    except (OSError, ValueError) as error:
        raise ControlError(f"no executor answers at {path}: {error}") from error
    if not answer.get("ok"):
        raise ControlError(str(answer.get("error", "refused")))
    return answer


class ControlChannel:
    """Serves one executor; ``stop_robot`` is called at once, from the serving thread."""

    def __init__(self, executor: Executor, stop_robot: Callable[[], None], task: str) -> None:
        self._executor = executor
        self._stop_robot = stop_robot
        self._task = task
        self._subscribers: list[_Subscriber] = []
        self._lock = threading.Lock()

    @contextmanager
    def serving(self, run_folder: Path | None = None) -> Iterator[Path]:
        """Serve until the context ends; ``control.sock`` in ``run_folder`` links to the socket."""
        path = socket_folder() / f"{os.getpid()}-{id(self):x}.sock"
        path.unlink(missing_ok=True)
        mask = os.umask(0o177)
        try:
            server = _Server(str(path), self)
        finally:
            os.umask(mask)
        thread = threading.Thread(target=server.serve_forever, args=(0.1,), name="control-channel", daemon=True)
        thread.start()
        link = run_folder / "control.sock" if run_folder is not None else None
        if link is not None:
            link.symlink_to(path)
        self._executor.tree.subscribe(self._publish)
        try:
            yield path
        finally:
            self._executor.tree.unsubscribe(self._publish)
            server.shutdown()
            server.server_close()
            path.unlink(missing_ok=True)
            if link is not None:
                link.unlink(missing_ok=True)

    def answer(self, message: Any, stream: Any) -> dict[str, Any]:
        """Carry out one request."""
        what = message.get("do") if isinstance(message, dict) else None
        executor = self._executor
        match what:
            case "stop":
                self._stop_robot()
                executor.cancel("stopped through the control channel")
            case "halt":
                executor.cancel("halted through the control channel")
            case "pause":
                executor.pause()
            case "resume":
                executor.resume()
            case "step":
                executor.step()
            case "set":
                key, value = message.get("key"), message.get("value")
                if not isinstance(key, str) or not key:
                    return {"ok": False, "error": "set wants a key (text) and a value"}
                executor.between_ticks(lambda: executor.tree.blackboard.set(key, value))
            case "subscribe":
                with self._lock:
                    self._subscribers.append(_Subscriber(stream))
            case "status":
                pass
            case _:
                known = "status, subscribe, pause, resume, step, set, halt, stop"
                return {"ok": False, "error": f"unknown request {what!r}; known: {known}"}
        return {
            "ok": True,
            "task": self._task,
            "pid": os.getpid(),
            "ticks": executor.ticks,
            "time": executor.clock.now(),
            "paused": executor.paused,
            "root": status_name(executor.tree.root.state),
        }

    def forget(self, stream: Any) -> None:
        """Drop a subscriber that has gone."""
        with self._lock:
            for subscriber in [s for s in self._subscribers if s.stream is stream]:
                subscriber.close()
                self._subscribers.remove(subscriber)

    def _publish(self, changes: StateChanges) -> None:
        with self._lock:
            subscribers = list(self._subscribers)
        if not subscribers:
            return
        nodes = self._executor.tree.nodes
        told = [[nodes[uid - 1].path, status_name(state)] for uid, state in changes]
        line = json.dumps({"time": changes.stamp, "changes": told}).encode() + b"\n"
        for subscriber in subscribers:
            subscriber.send(line)


class _Subscriber:
    """Writes in a thread of its own, so that a reader who sleeps never holds up the robot; what overflows is lost."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self._lines: queue.Queue[bytes | None] = queue.Queue(MAX_BACKLOG)
        threading.Thread(target=self._write, name="control-subscriber", daemon=True).start()

    def send(self, line: bytes | None) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(line)

    def close(self) -> None:
        self.send(None)

    def _write(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            while (line := self._lines.get()) is not None:
                self.stream.write(line)
                self.stream.flush()


class _Server(socketserver.ThreadingUnixStreamServer):
    daemon_threads = True

    def __init__(self, path: str, channel: ControlChannel) -> None:
        self.channel = channel
        super().__init__(path, _Handler)


class _Handler(socketserver.StreamRequestHandler):
    server: _Server

    def handle(self) -> None:
        channel = self.server.channel
        with contextlib.suppress(OSError):
            for line in iter(lambda: self.rfile.readline(MAX_REQUEST), b""):
                try:
                    answer = channel.answer(json.loads(line), self.wfile)
                except ValueError:
                    answer = {"ok": False, "error": "a request is one JSON object a line"}
                self.wfile.write(json.dumps(answer).encode() + b"\n")
                self.wfile.flush()
        channel.forget(self.wfile)
