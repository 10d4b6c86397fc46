"""Ports on which a test lets a program listen."""

from __future__ import annotations

import random
import socket


def free_port() -> int:
    """A port that is free, as is the next one, below those that the system gives to outgoing connections.

    One of those may be taken before the port is used.
    """
    while True:
        port = random.SystemRandom().randrange(20_000, 32_000)
        with socket.socket() as first, socket.socket() as second:
            try:
                first.bind(("127.0.0.1", port))
                second.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
            return port
