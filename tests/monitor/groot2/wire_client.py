"""A client that speaks Groot2's protocol."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import zmq
from zmq.utils.monitor import recv_monitor_message

IDENTIFIER = 0x01020304
TIMEOUT = 60_000


class Groot2Client:
    """Asks a publisher, as Groot2 does, and hears of breakpoints."""

    def __init__(self, port: int) -> None:
        self._context = zmq.Context()
        self._requests = self._context.socket(zmq.REQ)
        self._requests.setsockopt(zmq.RCVTIMEO, TIMEOUT)
        self._requests.connect(f"tcp://127.0.0.1:{port}")
        self._breakpoints = self._context.socket(zmq.SUB)
        self._breakpoints.setsockopt(zmq.RCVTIMEO, TIMEOUT)
        self._breakpoints.setsockopt(zmq.SUBSCRIBE, b"")
        self._subscribing: zmq.Socket[bytes] | None
        self._subscribing = self._breakpoints.get_monitor_socket(zmq.Event.HANDSHAKE_SUCCEEDED)
        self._subscribing.setsockopt(zmq.RCVTIMEO, TIMEOUT)
        self._breakpoints.connect(f"tcp://127.0.0.1:{port + 1}")

    def send(self, *parts: bytes) -> list[bytes]:
        """The parts of the answer to these parts.

        The first request waits until the other socket has connected: what is published before is lost.
        """
        if self._subscribing is not None:
            recv_monitor_message(self._subscribing)
            self._breakpoints.disable_monitor()
            self._subscribing = None
        self._requests.send_multipart(parts)
        return self._requests.recv_multipart()

    def ask(self, letter: str, content: bytes | dict[str, Any] | list[Any] | None = None) -> list[bytes]:
        """The parts of the answer to a request."""
        header = struct.pack("<BBI", 2, ord(letter), IDENTIFIER)
        if content is None:
            return self.send(header)
        return self.send(header, content if isinstance(content, bytes) else json.dumps(content).encode())

    def states(self) -> dict[int, int]:
        """uid → state, as it is shown."""
        content = self.ask("S")[1]
        return dict(struct.iter_unpack("<HB", content))

    def transitions(self) -> list[tuple[int, int, int]]:
        """Microseconds, uid and state of what was recorded since the last call."""
        content = self.ask("t")[1]
        return [
            (int.from_bytes(content[at : at + 6], "little"), *struct.unpack_from("<HB", content, at + 6))
            for at in range(0, len(content), 9)
        ]

    def breakpoint(self) -> list[bytes]:
        """The parts of the next message that a breakpoint was reached."""
        return self._breakpoints.recv_multipart()

    def close(self) -> None:
        self._context.destroy(linger=0)


@contextmanager
def groot2_client(port: int) -> Iterator[Groot2Client]:
    client = Groot2Client(port)
    try:
        yield client
    finally:
        client.close()


def hook(uid: int, mode: int, status: str = "SKIPPED", position: int = 0, once: bool = False) -> dict[str, Any]:
    """A request for a hook: mode 0 breakpoint, 1 replace; position 0 before, 1 after."""
    return {
        "enabled": True,
        "uid": uid,
        "mode": mode,
        "once": once,
        "desired_status": status,
        "position": position,
    }
