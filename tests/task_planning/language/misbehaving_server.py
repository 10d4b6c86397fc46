"""A local server that speaks the chat-completions protocol, and misbehaves in the ways that it is told."""

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
    """``ways``: one for each question, the last one for all that follow. ``questions``: the bodies that came."""

    daemon_threads = True

    def __init__(self, ways: Sequence[Way]) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.ways = list(ways)
        self.questions: list[dict[str, Any]] = []
        self.raw: list[bytes] = []
        self.headers: list[dict[str, str]] = []

    @property
    def base_url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/v1"


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.raw.append(body)
        self.server.questions.append(json.loads(body))
        self.server.headers.append(dict(self.headers))
        if self.path != "/v1/chat/completions":
            send(self, 404, b'{"error": {"message": "no such path"}}')
            return
        ways = self.server.ways
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            (ways.pop(0) if len(ways) > 1 else ways[0])(self)

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def serving(*ways: Way) -> Iterator[Server]:
    """A server on this machine that answers so."""
    server = Server(ways)
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


def completion(message: dict[str, Any], finish: str = "stop") -> bytes:
    return json.dumps(
        {
            "id": "chatcmpl-1",
            "object": "chat.completion",
            "model": "test",
            "choices": [{"index": 0, "message": {"role": "assistant", **message}, "finish_reason": finish}],
            "usage": {"prompt_tokens": 1000, "completion_tokens": 50, "total_tokens": 1050},
        }
    ).encode()


def says(content: object) -> Way:
    """An answer: text as it is, anything else as JSON."""
    text = content if isinstance(content, str) else json.dumps(content)
    return lambda handler: send(handler, 200, completion({"content": text}))


def refuses(text: str) -> Way:
    """The refusal of structured outputs, beside the content."""
    return lambda handler: send(handler, 200, completion({"content": None, "refusal": text}))


def fails(status: int, text: str = "it broke", **headers: str) -> Way:
    return lambda handler: send(handler, status, json.dumps({"error": {"message": text}}).encode(), **headers)


def raw(content: bytes) -> Way:
    return lambda handler: send(handler, 200, content)


def calls_a_tool(name: str, arguments: dict[str, Any]) -> Way:
    call = {"id": "call_1", "type": "function", "function": {"name": name, "arguments": json.dumps(arguments)}}
    return lambda handler: send(handler, 200, completion({"content": None, "tool_calls": [call]}, "tool_calls"))


def sleeps(seconds: float) -> Way:
    def way(handler: Handler) -> None:
        time.sleep(seconds)
        send(handler, 200, completion({"content": "too late"}))

    return way


def drips(handler: Handler) -> None:
    """A byte now and then, for ever."""
    handler.send_response(200)
    handler.send_header("Content-Length", "1000000")
    handler.end_headers()
    with contextlib.suppress(OSError):
        for _ in range(200):
            handler.wfile.write(b" ")
            time.sleep(0.02)


def breaks_off(content: object) -> Way:
    """The stream ends in mid-answer."""
    whole = completion({"content": json.dumps(content)})

    def way(handler: Handler) -> None:
        handler.send_response(200)
        handler.send_header("Content-Length", str(len(whole)))
        handler.end_headers()
        handler.wfile.write(whole[: len(whole) // 2])
        handler.close_connection = True

    return way


def stops_at_length(content: object) -> Way:
    """The model reaches its limit of tokens in mid-answer."""
    text = json.dumps(content)
    return lambda handler: send(handler, 200, completion({"content": text[: len(text) // 2]}, "length"))


def without(field: str, then: Way) -> Way:
    """An older server, that refuses one of the optional fields."""

    def way(handler: Handler) -> None:
        if field in handler.server.questions[-1]:
            fails(400, f"Unrecognized request argument supplied: {field}")(handler)
        else:
            then(handler)

    return way
