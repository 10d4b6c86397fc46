"""An executor that speaks the control channel's protocol and does as it is told, and a monitor that serves it."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.sync.client import ClientConnection, connect

from bestman_bt.monitor.control_client import socket_folder
from bestman_bt.monitor.server import MonitorServer, ServerConfig, bind

NODES = [
    (1, None, "main", "Sequence", "control"),
    (2, 1, "look", "LookAt", "action"),
    (3, 1, "again", "RetryUntilSuccessful", "decorator"),
    (4, 3, "grasp", "Grasp", "action"),
]
Message = dict[str, Any]


def run_event(**changed: Any) -> Message:
    return {
        "event": "run",
        "version": 1,
        "task": "fetch",
        "tree": "fetch_cup",
        "scene": "kitchen",
        "robot": "diff_panda",
        "seed": 7,
        "folder": "",
        "pid": os.getpid(),
        "started": 1000.0,
        "tick_rate": 20.0,
        "clock": "simulated",
        **changed,
    }


def tree_event(nodes: list[tuple[int, int | None, str, str, str]] | None = None, **changed: Any) -> Message:
    told = [
        {"uid": uid, "parent": parent, "name": name, "type": kind, "category": category}
        | {"path": f"main/{name}", "ports": {"arm": "left"}, "scope": ""}
        for uid, parent, name, kind, category in nodes or NODES
    ]
    return {"event": "tree", "nodes": told, "xml": "", "id": "Main", **changed}


def states_event(time_s: float, *changes: tuple[int, int], **more: Any) -> Message:
    return {"event": "states", "time": time_s, "tick": round(time_s * 20), "changes": list(changes), **more}


class FakeExecutor:
    """Serves a socket as executors do; ``tell`` reaches all subscribers, ``asked`` holds what was requested."""

    def __init__(self, name: str = "4242-abc", nodes: list[Any] | None = None, **about: Any) -> None:
        self.path = socket_folder() / f"{name}.sock"
        self.first = [run_event(**about), tree_event(nodes), states_event(0.0)]
        self.asked: list[Message] = []
        self.answer: Message = {"ok": True}
        self.unanswered: set[str] = set()
        self.subscribers: list[socket.socket] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        bound = self.path.with_suffix(".new")
        self._socket.bind(str(bound))
        self._socket.listen()
        bound.rename(self.path)
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            self._read(connection)
        if connection in self.subscribers:
            self.subscribers.remove(connection)

    def _read(self, connection: socket.socket) -> None:
        for line in connection.makefile("rb"):
            message = json.loads(line)
            self.asked.append(message)
            if message["do"] in self.unanswered:
                continue
            connection.sendall(json.dumps(self.answer).encode() + b"\n")
            if message["do"] == "subscribe":
                for event in self.first:
                    connection.sendall(json.dumps(event).encode() + b"\n")
                self.subscribers.append(connection)

    def tell(self, *events: Message) -> None:
        """Send events to everybody who has subscribed."""
        wait_until(lambda: bool(self.subscribers), "somebody subscribes")
        for event in events:
            for connection in list(self.subscribers):
                with contextlib.suppress(OSError):  # it has just gone
                    connection.sendall(json.dumps(event).encode() + b"\n")

    def close(self) -> None:
        """Be gone, as a process that ends is."""
        self.path.unlink(missing_ok=True)
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        for connection in list(self.subscribers):
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)


def wait_until(holds: Callable[[], bool], what: str, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"not within {seconds} s: {what}"
        time.sleep(0.01)


class Page:
    """A WebSocket client that reads messages as the page does."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.seen: list[Message] = []

    def ask(self, what: str, **more: Any) -> None:
        self.connection.send(json.dumps({"do": what, **more}))

    def next(
        self, kind: str, holds: Callable[[Message], bool] = lambda message: True, seconds: float = 60.0
    ) -> Message:
        """The next message of a kind for which ``holds``; others are read and kept in ``seen``."""
        end = time.monotonic() + seconds
        while True:
            try:
                message = json.loads(self.connection.recv(timeout=max(0.01, end - time.monotonic())))
            except TimeoutError:
                kinds = [seen["type"] for seen in self.seen]
                raise AssertionError(f"no such {kind} within {seconds} s, but {kinds}") from None
            self.seen.append(message)
            if message["type"] == kind and holds(message):
                return message


class Monitor:
    """A monitor that serves in a thread."""

    def __init__(self, config: ServerConfig) -> None:
        listening = bind(config.host, config.port)
        self.port = listening.getsockname()[1]
        self.host = f"127.0.0.1:{self.port}"
        self.token = config.token
        self.server = MonitorServer(
            ServerConfig(**{**vars(config), "port": self.port}),
        )
        started = threading.Event()
        self._thread = threading.Thread(target=self.server.run, args=(listening, started.set), daemon=True)
        self._thread.start()
        assert started.wait(30.0)

    def http(self) -> httpx.Client:
        return httpx.Client(base_url=f"http://{self.host}", trust_env=False)

    @contextmanager
    def page(self, **headers: str) -> Iterator[Page]:
        given = {"Origin": f"http://{self.host}", **headers}
        with connect(f"ws://{self.host}/ws", additional_headers=given, max_size=None, proxy=None) as connection:
            yield Page(connection)

    def close(self) -> None:
        self.server.end()
        self._thread.join(30.0)
        assert not self._thread.is_alive()


@pytest.fixture(autouse=True)
def own_sockets(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sockets of these tests are apart from those of anybody's robots."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))


@pytest.fixture
def executor() -> Iterator[FakeExecutor]:
    """An executor that runs a tree of four nodes."""
    fake = FakeExecutor()
    yield fake
    if fake.path.exists():
        fake.close()


@pytest.fixture
def start_monitor() -> Iterator[Callable[..., Monitor]]:
    """Starts monitors on free ports, and ends them."""
    monitors: list[Monitor] = []

    def start(*folders: Path, **config: Any) -> Monitor:
        monitors.append(Monitor(ServerConfig(**{"port": 0, "folders": folders, **config})))
        return monitors[-1]

    yield start
    for monitor in monitors:
        monitor.close()
