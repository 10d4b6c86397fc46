"""The queue of lines to one reader of the control channel, which may be slow, stopped or hostile."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections import deque

MAX_BACKLOG = 4 << 20
"""Largest number of bytes queued for a reader; further lines are dropped."""
LAST_WORDS = 0.2
"""Seconds that a closing connection gets to receive the remaining events."""


class SubscriberQueue:
    """Writes to one connection in a separate thread: a reader that does not read never blocks the robot.

    On overflow, lines are dropped until half of the queue has been read; ``dropped`` counts them.
    """

    def __init__(self, connection: socket.socket, backlog: int = MAX_BACKLOG) -> None:
        self._connection = connection
        self._backlog = backlog
        self._lines: deque[bytes] = deque()
        self._waiting = 0
        self._closing = False
        self._changed = threading.Condition()
        self.dropped = 0
        self._thread = threading.Thread(target=self._write, name="control-outbox", daemon=True)
        self._thread.start()

    @property
    def has_room(self) -> bool:
        """Return whether the queue has room to resend the current state after lines were dropped."""
        return self._waiting <= self._backlog // 2

    def send(self, line: bytes) -> bool:
        """Queue a line. Returns False if it was dropped."""
        with self._changed:
            if self._waiting and self._waiting + len(line) > self._backlog:
                self.dropped += 1
                return False
            self._lines.append(line)
            self._waiting += len(line)
            self._changed.notify()
        return True

    def close(self) -> None:
        """Give the reader a moment to receive the rest, then end the connection; idempotent."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(LAST_WORDS)
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                with self._changed:
                    while not self._lines and not self._closing:
                        self._changed.wait()
                    if not self._lines:
                        return
                    line = self._lines.popleft()
                self._connection.sendall(line)
                with self._changed:
                    self._waiting -= len(line)
