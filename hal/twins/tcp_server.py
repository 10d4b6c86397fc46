"""Common parts of the twins' servers: TCP ports with simulated wire faults, and requests as JSON lines."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hal.api import RobotError
from hal.twins.faults import Faults

POLL = 0.05
"""Seconds until a server notices that it should close."""


class _BackgroundServer(socketserver.ThreadingTCPServer):
    """Serves in the background from ``start()`` to ``close()``, each client in its own thread."""

    allow_reuse_address = daemon_threads = True
    _started = False

    def start(self) -> None:
        """Accept clients."""
        self._started = True
        threading.Thread(target=self.serve_forever, args=(POLL,), name="twin server", daemon=True).start()

    def close(self) -> None:
        """Stop accepting; connections end with the process."""
        if self._started:
            self.shutdown()
        self.server_close()


Answer = Callable[[dict[str, Any]], Mapping[str, Any]]


class JsonLineServer(_BackgroundServer, socketserver.UnixStreamServer):
    """Answers each line with ``answer(question)``; exceptions become ``{"error": …}``."""

    def __init__(self, path: Path, answer: Answer) -> None:
        self.path, self.answer = path, answer
        mask = os.umask(0o177)
        try:
            super().__init__(str(path), _JsonLines)
        finally:
            os.umask(mask)

    def server_close(self) -> None:
        """Close the socket and remove it."""
        super().server_close()
        self.path.unlink(missing_ok=True)


class _JsonLines(socketserver.StreamRequestHandler):
    server: JsonLineServer

    def handle(self) -> None:
        with contextlib.suppress(OSError):  # the client is gone
            for line in self.rfile:
                try:
                    answer = dict(self.server.answer(json.loads(line)))
                except (LookupError, ValueError, TypeError, RobotError, TimeoutError) as error:
                    answer = {"error": str(error)}
                self.wfile.write(json.dumps(answer).encode() + b"\n")


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


Serve = Callable[[socket.socket], None]


class _Port(_BackgroundServer):
    """Calls ``serve(socket)`` for each client; an OSError ends its client."""

    def __init__(self, address: str, port: int, serve: Serve) -> None:
        self._serve = serve
        self.clients: set[socket.socket] = set()
        super().__init__((address, port), socketserver.BaseRequestHandler)

    def finish_request(self, request: Any, client_address: Any) -> None:
        request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.clients.add(request)
        try:
            with contextlib.suppress(OSError):  # the client is gone
                self._serve(request)
        finally:
            self.clients.discard(request)


class TcpTwin:
    """A controller that listens on TCP ports of ``address``: port → function that serves a client, in its own thread.

    Raises OSError, with no port left open, if one is taken or needs privileges. Its fault ``restart`` disconnects all
    clients.
    """

    def __init__(self, address: str, ports: Mapping[int, Serve]) -> None:
        self.faults = Faults()
        self.faults.add({"restart": self.close_clients})
        with contextlib.ExitStack() as opened:
            self._ports = [opened.enter_context(_Port(address, port, serve)) for port, serve in ports.items()]
            opened.pop_all()

    def start(self) -> None:
        """Accept clients."""
        for port in self._ports:
            port.start()

    def close(self) -> None:
        """Close all ports."""
        for port in self._ports:
            port.close()

    def close_clients(self) -> None:
        """Close all connections, as a restarting controller does."""
        for client in [client for port in self._ports for client in tuple(port.clients)]:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)

    def received(self, client: socket.socket) -> Iterator[bytes]:
        """Yield the received bytes of a client, with the faults of the wire applied, until it disconnects."""
        while chunk := client.recv(65536):
            if not self.faults.wire.silent:
                time.sleep(self.faults.wire.delay)
                yield chunk

    def send(self, client: socket.socket, data: bytes) -> None:
        """Send to a client, unless the wire is silent."""
        if not self.faults.wire.silent:
            client.sendall(data)


def lines(chunks: Iterable[bytes]) -> Iterator[str]:
    """Yield the complete lines of a stream of ASCII text, without their ends."""
    text = b""
    for chunk in chunks:
        *complete, text = (text + chunk).split(b"\n")
        yield from (line.decode("ascii", "replace") for line in complete)


def modbus_frames(chunks: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the frames of a stream, as in Modbus TCP: bytes 4 and 5 of the 6-byte header give the length of the
    rest."""
    data = b""
    for chunk in chunks:
        data += chunk
        while len(data) >= 6 and len(data) >= (size := 6 + int.from_bytes(data[4:6], "big")):
            frame, data = data[:size], data[size:]
            yield frame
