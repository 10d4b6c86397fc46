"""A small TCP server: a thread per client, closed as one."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hal.api import RobotError

# Questions and answers as lines of JSON over a Unix socket that only its owner may open.


Answer = Callable[[dict[str, Any]], Mapping[str, Any]]


class JsonLineServer:
    """Answers each line with ``answer(question)``; exceptions become ``{"error": …}``."""

    def __init__(self, path: Path, answer: Answer) -> None:
        self._path, self._answer = path, answer
        self._socket = socket.socket(socket.AF_UNIX)
        mask = os.umask(0o177)
        try:
            self._socket.bind(str(path))
        finally:
            os.umask(mask)
        self._socket.listen(4)

    def start(self) -> None:
        """Accept clients."""
        threading.Thread(target=self._accept, name=self._path.name, daemon=True).start()

    def close(self) -> None:
        """Close the socket and remove it."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._attend, args=(client,), name=self._path.name, daemon=True).start()

    def _attend(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError), client.makefile("rwb") as stream:
            for line in stream:
                try:
                    answer = dict(self._answer(json.loads(line)))
                except (LookupError, ValueError, TypeError, RobotError, TimeoutError) as error:
                    answer = {"error": str(error)}
                stream.write(json.dumps(answer).encode() + b"\n")
                stream.flush()


def ask(path: Path, question: Mapping[str, Any], timeout: float = 10.0) -> dict[str, Any]:
    """Send one question and return its answer. Raises LookupError with the text of an error answer."""
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(timeout)
        client.connect(str(path))
        with client.makefile("rwb") as stream:
            stream.write(json.dumps(dict(question)).encode() + b"\n")
            stream.flush()
            answer: dict[str, Any] = json.loads(stream.readline())
    if "error" in answer:
        raise LookupError(answer["error"])
    return answer


class TcpServer:
    """Accepts on ``address``:``port`` and calls ``serve(socket)`` for each client in a separate thread.

    Raises OSError if the port is taken or needs privileges. An OSError of ``serve`` ends its client.
    """

    def __init__(self, address: str, port: int, serve: Callable[[socket.socket], None]) -> None:
        self._serve = serve
        self._socket = socket.socket()
        self._clients: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._closing = False
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind((address, port))
            self._socket.listen(8)
        except OSError:
            self._socket.close()
            raise
        self._name = f"port {port}"

    def start(self) -> None:
        """Accept clients."""
        threading.Thread(target=self._accept, name=self._name, daemon=True).start()

    @property
    def clients(self) -> int:
        """Return the number of connected clients."""
        return len(self._clients)

    def close(self) -> None:
        """Close the port and all clients."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self.close_clients()

    def close_clients(self) -> None:
        """Close all clients' connections."""
        with self._lock:
            clients = tuple(self._clients)
        for client in clients:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while not self._closing:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._attend, args=(client,), name=self._name, daemon=True).start()

    def _attend(self, client: socket.socket) -> None:
        with self._lock:
            self._clients.add(client)
        try:
            self._serve(client)
        except OSError:
            pass  # the client is gone
        finally:
            with self._lock:
                self._clients.discard(client)
            client.close()
