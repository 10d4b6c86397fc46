"""Connections to the monitor: a bounded number, each with a short time for its request, so that a stop always gets in.

Half-open connections, which send no request, do not keep out the others.
"""

from __future__ import annotations

import asyncio
import resource
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEADER_TIME = 5.0
"""Seconds from the connection on in which a request has to have come."""
MOST_CONNECTIONS = 256
RESERVED = 96
"""File descriptors that connections leave for files and for the sockets of executors."""


def most_connections() -> int:
    """Return the largest number of connections; smaller if the process may open few file descriptors."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_CONNECTIONS if soft == resource.RLIM_INFINITY else max(16, min(MOST_CONNECTIONS, soft - RESERVED))


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 connections of a bounded number: at the limit, the one that has waited longest is closed.

    An answer takes milliseconds, so the oldest connection sends no request or does not read. Pages stay connected:
    their
    WebSockets have separate protocols.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # a socket's
        """Start the deadline for the request."""
        self._overdue = self.loop.call_later(HEADER_TIME, transport.abort)
        if len(self.connections) >= most_connections():
            waiting = (other for other in self.connections if isinstance(other, BoundedProtocol))
            oldest = min(waiting, key=lambda other: other._overdue.when(), default=None)
            if oldest is not None:
                self.connections.discard(oldest)
                oldest.transport.abort()
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        """End the deadline: the request has arrived. Between requests uvicorn's timeout applies."""
        super().data_received(data)
        if self.cycle is not None:
            self._overdue.cancel()

    def handle_websocket_upgrade(self, *arguments: Any) -> None:
        """A page: it is pinged from now on."""
        self._overdue.cancel()
        super().handle_websocket_upgrade(*arguments)

    def connection_lost(self, exc: Exception | None) -> None:
        """It waits no more."""
        self._overdue.cancel()
        super().connection_lost(exc)
