"""The control channel: a Unix socket through which others watch, pause, step, halt, set and stop an execution.

One JSON object a line in each direction. Requests: ``{"do": "stop"}``, also ``halt``, ``pause``, ``resume``, ``step``,
``status``, ``subscribe`` and ``{"do": "set", "key": …, "value": …}``. Each is answered by ``{"ok": true, …}`` or
``{"ok": false, "error": …}``; a subscriber also gets ``{"time": …, "changes": [[path, state], …]}`` for each tick that
changed something, until the execution ends.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import socket
import socketserver
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bestman_bt.engine import EngineError, StateChanges, status_name
from bestman_bt.monitor.control_client import socket_folder
from bestman_bt.runtime.executor import Executor

MAX_REQUEST = 65536
MAX_BACKLOG = 4096
LAST_WORDS = 0.2
"""Seconds that a connection gets at its end to take what is still to be told."""
SET_WAIT = 2.0
"""Seconds that ``set`` waits for the tick that goes on."""


class ControlChannel:
    """Serves one executor; ``stop_robot`` is called at once, from the serving thread: a stop that no tree may clear."""

    def __init__(self, executor: Executor, stop_robot: Callable[[], None], task: str) -> None:
        self._executor = executor
        self._stop_robot = stop_robot
        self._task = task
        self._subscribers: list[_Outbox] = []
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
            with self._lock:
                subscribers = list(self._subscribers)
            for subscriber in subscribers:
                subscriber.close()

    def answer(self, message: Any) -> dict[str, Any]:
        """Carry out one request."""
        what = message.get("do") if isinstance(message, dict) else None
        executor = self._executor
        match what:
            case "stop":
                executor.cancel("stopped through the control channel")
                self._stop_robot()
            case "halt":
                executor.cancel("halted through the control channel")
            case "pause":
                executor.pause()
            case "resume":
                executor.resume()
            case "step":
                executor.step()
            case "set":
                error = self._set(message.get("key"), message.get("value"))
                if error:
                    return {"ok": False, "error": error}
            case "status" | "subscribe":
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

    def add(self, subscriber: _Outbox) -> None:
        """Tell somebody of every change from now on."""
        with self._lock:
            self._subscribers.append(subscriber)

    def forget(self, subscriber: _Outbox) -> None:
        """Tell somebody nothing more."""
        with self._lock:
            if subscriber in self._subscribers:
                self._subscribers.remove(subscriber)

    def _set(self, key: Any, value: Any) -> str:
        """Set a root entry between ticks; returns what was wrong."""
        if not isinstance(key, str) or not key:
            return "set wants a key (text) and a value"
        executor = self._executor
        try:
            executor.between_ticks(lambda: executor.tree.blackboard.set(key, value)).result(SET_WAIT)
        except EngineError as error:
            return str(error)
        except (CancelledError, TimeoutError):
            return "the tree does not tick any more"
        return ""

    def _publish(self, changes: StateChanges) -> None:
        with self._lock:
            subscribers = list(self._subscribers)
        if not subscribers:
            return
        nodes = self._executor.tree.nodes
        told = [[nodes[uid - 1].path, status_name(state)] for uid, state in changes]
        for subscriber in subscribers:
            subscriber.send({"time": changes.stamp, "changes": told})


class _Outbox:
    """Writes to one connection in a thread of its own: a reader who sleeps never holds up the robot.

    What overflows is lost.
    """

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._lines: queue.Queue[bytes | None] = queue.Queue(MAX_BACKLOG)
        self._thread = threading.Thread(target=self._write, name="control-outbox", daemon=True)
        self._thread.start()

    def send(self, message: dict[str, Any]) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(json.dumps(message).encode() + b"\n")

    def close(self) -> None:
        """Give the reader a moment to take the rest, then end the connection."""
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(None)
        self._thread.join(LAST_WORDS)
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while (line := self._lines.get()) is not None:
                self._connection.sendall(line)


class _Server(socketserver.ThreadingUnixStreamServer):
    daemon_threads = True

    def __init__(self, path: str, channel: ControlChannel) -> None:
        self.channel = channel
        super().__init__(path, _Handler)


class _Handler(socketserver.StreamRequestHandler):
    server: _Server

    def handle(self) -> None:
        channel, outbox = self.server.channel, _Outbox(self.connection)
        with contextlib.suppress(OSError):
            for line in iter(lambda: self.rfile.readline(MAX_REQUEST), b""):
                try:
                    message = json.loads(line)
                except ValueError:
                    outbox.send({"ok": False, "error": "a request is one JSON object a line"})
                    continue
                outbox.send(channel.answer(message))
                if isinstance(message, dict) and message.get("do") == "subscribe":
                    channel.add(outbox)
        channel.forget(outbox)
        outbox.close()
