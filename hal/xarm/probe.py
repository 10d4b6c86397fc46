"""Whether a controller answers at all: the SDK would try for minutes."""

from __future__ import annotations

import socket
import struct

CONTROL_PORT = 502
GET_VERSION = struct.pack(">HHHB", 1, 2, 1, 1)
"""Transaction 1 of UFACTORY's private protocol (2), one byte: register 1."""


def answers(address: str, timeout: float) -> bool:
    """Whether the control box at ``address`` tells its version within ``timeout`` seconds."""
    try:
        with socket.create_connection((address, CONTROL_PORT), timeout) as wire:
            wire.settimeout(timeout)
            wire.sendall(GET_VERSION)
            return bool(wire.recv(64))
    except OSError:
        return False
