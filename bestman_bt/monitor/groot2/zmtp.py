"""ZeroMQ's transport, ZMTP 3.0 (RFC 23) without security, for one client socket, and with every size bounded.

libzmq bounds the parts of a message but not their number: a hostile server could fill the memory.
"""

from __future__ import annotations

import contextlib
import socket
import time

from bestman_bt.monitor.groot2.protocol import Groot2Error

MOST_BYTES = 64 << 20
"""Largest size of one message, bytes: a tree of 65,535 nodes has 15 million."""
MOST_PARTS = 8
GREETING = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
_MORE, _LONG, _COMMAND = 1, 2, 4
_AT_ONCE = 1 << 16


class ZmtpConnection:
    """A ZeroMQ client socket of the kind ``REQ`` or ``SUB``; a context manager. ``timeout``: seconds for a whole
    message.

    Raises:
        Groot2Error: nothing listens there, or the peer does not speak ZeroMQ, is too slow, or sends too much.
    """

    def __init__(self, host: str, port: int, kind: str, timeout: float, most_bytes: int = MOST_BYTES) -> None:
        self._address, self._timeout, self._most_bytes = f"{host}:{port}", timeout, most_bytes
        self._deadline = time.monotonic() + timeout
        try:
            self._socket = socket.create_connection((host, port), timeout)
        except (OSError, UnicodeError) as error:
            raise Groot2Error(f"no process answers at {self._address}: {error}") from error
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._shake_hands(kind)
        except BaseException:
            self._socket.close()
            raise

    def fileno(self) -> int:
        """Return the file descriptor for ``select``: readable when a message starts to arrive."""
        return self._socket.fileno()

    def send(self, *parts: bytes) -> None:
        """Send one message."""
        last = len(parts) - 1
        self._send(b"".join(frame_of(part, _MORE if number < last else 0) for number, part in enumerate(parts)))

    def receive(self) -> list[bytes]:
        """Return the parts of the next message."""
        self._deadline = time.monotonic() + self._timeout
        parts: list[bytes] = []
        room = self._most_bytes
        while True:
            flags, body = self._read_frame(room)
            if flags & _COMMAND:
                continue
            parts.append(body)
            room -= len(body)
            if not flags & _MORE:
                return parts
            if len(parts) == MOST_PARTS:
                raise Groot2Error(f"{self._address} sends a message of more than {MOST_PARTS} parts")

    def close(self) -> None:
        """End the connection."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def __enter__(self) -> ZmtpConnection:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _shake_hands(self, kind: str) -> None:
        self._send(GREETING)
        greeting = self._read(len(GREETING))
        if greeting[0] != 0xFF or greeting[9] & 1 == 0 or greeting[10] < 3:
            raise Groot2Error(f"{self._address} does not speak ZeroMQ 4 or newer: it begins with {greeting[:12]!r}")
        if greeting[12:32].rstrip(b"\0") != b"NULL":
            raise Groot2Error(f"{self._address} demands the security {greeting[12:32].rstrip(bytes(1))!r}")
        properties = b"\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind.encode()
        self._send(frame_of(b"\x05READY" + properties, _COMMAND))
        flags, body = self._read_frame(_AT_ONCE)
        if not flags & _COMMAND or not body.startswith(b"\x05READY"):
            raise Groot2Error(f"{self._address} refuses the connection: {body[:80]!r}")
        if kind == "SUB":
            self.send(b"\x01")  # subscribes to all

    def _read_frame(self, room: int) -> tuple[int, bytes]:
        flags = self._read(1)[0]
        size = int.from_bytes(self._read(8 if flags & _LONG else 1), "big")
        if size > room:
            raise Groot2Error(f"{self._address} sends a message of {size} bytes; at most {self._most_bytes} are read")
        return flags, self._read(size)

    def _read(self, count: int) -> bytes:
        pieces: list[bytes] = []
        left = count
        while left:
            self._socket.settimeout(max(0.001, self._deadline - time.monotonic()))
            try:
                piece = self._socket.recv(min(left, _AT_ONCE))
            except TimeoutError as error:
                words = f"{self._address} has not sent a whole message within {self._timeout:g} s"
                raise Groot2Error(words) from error
            except OSError as error:
                raise Groot2Error(f"{self._address} is gone: {error}") from error
            if not piece:
                raise Groot2Error(
                    f"{self._address} has closed the connection" + (" within a message" if pieces else "")
                )
            pieces.append(piece)
            left -= len(piece)
        return b"".join(pieces)

    def _send(self, data: bytes) -> None:
        self._socket.settimeout(self._timeout)
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise Groot2Error(f"{self._address} is gone: {error}") from error


def frame_of(body: bytes, flags: int) -> bytes:
    """Return a frame: flags, length and body."""
    if len(body) < 256:
        return bytes([flags, len(body)]) + body
    return bytes([flags | _LONG]) + len(body).to_bytes(8, "big") + body
