"""A server on this machine that answers each POST as it is told, and misbehaves where it is told that."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

Way = Callable[["Handler"], None]


class Server(ThreadingHTTPServer):
    """``path``: where it is asked. ``ways``: one for each question, the last one for all that follow.

    ``questions``: the bodies that came; ``raw``: the same as bytes.
    """

    daemon_threads = True

    def __init__(self, path: str, ways: Sequence[Way]) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.path = path
        self.ways = list(ways)
        self.questions: list[dict[str, Any]] = []
        self.raw: list[bytes] = []
        self.headers: list[dict[str, str]] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}{self.path}"

    @property
    def base_url(self) -> str:
        """Of an endpoint for chat completions."""
        return self.url.removesuffix("/chat/completions")


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.raw.append(body)
        self.server.questions.append(json.loads(body))
        self.server.headers.append(dict(self.headers))
        if self.path != self.server.path:
            send(self, 404, b'{"error": {"message": "no such path"}}')
            return
        ways = self.server.ways
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            (ways.pop(0) if len(ways) > 1 else ways[0])(self)

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def serving_at(path: str, *ways: Way) -> Iterator[Server]:
    """A server on this machine that answers so."""
    server = Server(path, ways)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()


def send(handler: Handler, status: int, content: bytes, **headers: str) -> None:
    handler.send_response(status)
    handler.send_header("Content-Type", "application/json")
    handler.send_header("Content-Length", str(len(content)))
    for name, value in headers.items():
        handler.send_header(name.replace("_", "-"), value)
    handler.end_headers()
    handler.wfile.write(content)


def raw(content: bytes, status: int = 200, **headers: str) -> Way:
    return lambda handler: send(handler, status, content, **headers)


def sleeps(seconds: float, then: Way) -> Way:
    def way(handler: Handler) -> None:
        time.sleep(seconds)
        then(handler)

    return way


def drips(handler: Handler) -> None:
    """A byte of the body now and then, for ever."""
    handler.send_response(200)
    handler.send_header("Content-Length", "1000000")
    handler.end_headers()
    _drip(handler, b" ")


def drips_without_length(handler: Handler) -> None:
    """The same; where it is cut off, it seems whole."""
    handler.send_response(200)
    handler.end_headers()
    _drip(handler, b" ")


def drips_headers(handler: Handler) -> None:
    """A byte of a header now and then, for ever."""
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nX-Long: ")
    _drip(handler, b"x")


def breaks_off(whole: bytes) -> Way:
    """The stream ends in mid-answer."""

    def way(handler: Handler) -> None:
        handler.send_response(200)
        handler.send_header("Content-Length", str(len(whole)))
        handler.end_headers()
        handler.wfile.write(whole[: len(whole) // 2])
        handler.close_connection = True

    return way


def _drip(handler: Handler, byte: bytes) -> None:
    with contextlib.suppress(OSError):
        for _ in range(200):
            handler.wfile.write(byte)
            time.sleep(0.02)
