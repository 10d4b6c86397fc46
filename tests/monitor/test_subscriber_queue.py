"""A reader who sleeps is waited for by nobody, and gets what was kept for it."""

from __future__ import annotations

import socket
import threading
import time

from bestman_bt.monitor.subscriber_queue import SubscriberQueue


def test_what_overflows_is_dropped_and_counted_and_the_rest_arrives_before_the_end() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.settimeout(60.0)
        outbox = SubscriberQueue(ours, backlog=1000)
        assert outbox.has_room
        long = b"x" * 10_000_000  # more than a socket holds: its writer waits for the reader
        assert outbox.send(long)  # however long, one line always goes
        assert not outbox.send(b"dropped\n")
        assert not outbox.send(b"dropped\n")
        assert (outbox.dropped, outbox.has_room) == (2, False)
        received = _read(theirs, len(long))
        end = time.monotonic() + 60.0
        while not outbox.has_room:
            assert time.monotonic() < end
        assert outbox.send(b"last\n")
        closing = threading.Thread(target=outbox.close)
        closing.start()
        received += _read(theirs, 5)
        closing.join(60.0)
        outbox.close()
        assert received == long + b"last\n"
        assert theirs.recv(1) == b""
        assert outbox.dropped == 2


def _read(connection: socket.socket, count: int) -> bytes:
    received = bytearray()
    while len(received) < count:
        received += connection.recv(count - len(received))
    return bytes(received)
