"""A small TCP server: a thread per client, closed as one."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable


class TcpServer:
    """Accepts on ``address``:``port`` and calls ``serve(socket)`` in a thread of its own for each client.

    Raises OSError when the port is taken or needs privileges. ``serve`` may raise OSError, which ends its client.
    """

    def __init__(self, address: str, port: int, serve: Callable[[socket.socket], None]) -> None:
        self._serve = serve
        self._socket = socket.socket()
        self._clients: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._closing = False
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind((address, port))
            self._socket.listen(8)
        except OSError:
            self._socket.close()
            raise
        self._name = f"port {port}"

    def start(self) -> None:
        """Accept clients."""
        threading.Thread(target=self._accept, name=self._name, daemon=True).start()

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def close(self) -> None:
        """Close the port and all clients."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self.close_clients()

    def close_clients(self) -> None:
        """Close all clients' connections."""
        with self._lock:
            clients = tuple(self._clients)
        for client in clients:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while not self._closing:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._attend, args=(client,), name=self._name, daemon=True).start()

    def _attend(self, client: socket.socket) -> None:
        with self._lock:
            self._clients.add(client)
        try:
            self._serve(client)
        except OSError:
            pass  # the client is gone
        finally:
            with self._lock:
                self._clients.discard(client)
            client.close()
