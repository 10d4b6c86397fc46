"""The server of a control channel: a Unix socket in the user's folder, one JSON object per line."""

from __future__ import annotations

import contextlib
import json
import os
import socketserver
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from bestman_bt.errors import Error
from bestman_bt.monitor.control_client import ControlError, link_folder, remove_socket, socket_folder
from bestman_bt.monitor.subscriber_queue import SubscriberQueue
from bestman_bt.records.events import TOPICS, Topic

MAX_REQUEST = 65536
REQUEST_PAUSE = 0.005
"""Seconds between requests of one connection, so that a flood of requests does not delay the executor."""
Request = dict[str, Any]


class RequestRefusedError(Error):
    """A request cannot be executed."""


class Channel(Protocol):
    """Answers requests; called from threads of the socket."""

    def answer(self, message: Any) -> dict[str, Any]:
        """Execute one request."""

    def subscribe(self, message: Request, outbox: SubscriberQueue) -> None:
        """Start sending the events of a subscription that ``answer`` has accepted."""

    def forget(self, outbox: SubscriberQueue) -> None:
        """Send no more events to ``outbox``."""


@contextmanager
def serve(channel: Channel, run_folder: Path | None = None) -> Iterator[Path]:
    """Serve until the context ends; ``control.sock`` in ``run_folder`` links to the socket.

    Raises:
        ControlError: the folder of sockets is not this user's own, or its path is too long for a socket.
    """
    path = socket_folder() / f"{os.getpid()}-{id(channel):x}.sock"
    remove_socket(path)
    bound = path.with_suffix(".new")
    bound.unlink(missing_ok=True)
    mask = os.umask(0o177)
    try:
        server = _Server(str(bound), channel)
    except OSError as error:
        raise ControlError(f"no control socket {path}: {error}") from error
    finally:
        os.umask(mask)
    bound.rename(path)  # once it listens: clients remove a socket that refuses connections
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), name="control-channel", daemon=True)
    thread.start()
    if run_folder is not None:
        link_folder(path, run_folder)
    try:
        yield path
    finally:
        server.shutdown()
        server.server_close()
        remove_socket(path)


class _Server(socketserver.ThreadingUnixStreamServer):
    daemon_threads = True

    def __init__(self, path: str, channel: Channel) -> None:
        self.channel = channel
        super().__init__(path, _Handler)


class _Handler(socketserver.StreamRequestHandler):
    server: _Server

    def handle(self) -> None:
        outbox = SubscriberQueue(self.connection)
        with contextlib.suppress(OSError):
            for line in iter(lambda: self.rfile.readline(MAX_REQUEST), b""):
                self._carry_out(line, outbox)
                time.sleep(REQUEST_PAUSE)
        self.server.channel.forget(outbox)
        outbox.close()

    def _carry_out(self, line: bytes, outbox: SubscriberQueue) -> None:
        channel = self.server.channel
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            outbox.send(_answer_line({"ok": False, "error": "a request should be one JSON object per line"}))
            return
        answer = channel.answer(message)
        outbox.send(_answer_line(answer))
        if answer["ok"] and message["do"] == "subscribe":
            channel.subscribe(message, outbox)


def _answer_line(answer: dict[str, Any]) -> bytes:
    return json.dumps(answer).encode() + b"\n"


def topics_of(message: Request) -> frozenset[Topic]:
    """Return the topics of a subscription. Raises RequestRefusedError for an unknown topic."""
    topics = message.get("topics", list(TOPICS))
    if not isinstance(topics, list) or not all(topic in TOPICS for topic in topics):
        raise RequestRefusedError(f"topics should be a list of some of {', '.join(TOPICS)}")
    return frozenset(topics)
