"""Live events of episodes on other machines: the driver publishes them, so that its monitors show those runs."""

from __future__ import annotations

import os
import secrets
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, answer_challenge, deliver_challenge

from bestman_bt.monitor.control_client import ask_events, socket_folder
from bestman_bt.monitor.watched import WatchedExecution, refuse
from bestman_bt.records.events import Event, EventError, RunEvent, TreeEvent, from_line

LOOK = 0.05
"""Seconds between two searches for the executor of an episode."""
HANDSHAKE = 10
"""Time limit for each message of a client's handshake, seconds."""
MOST_CONNECTIONS = 100
"""Largest number of connections, each of one episode; further episodes are not shown."""
RETRY = 0.2
"""Seconds until a failed attempt to accept a connection is repeated, for example without a free file descriptor."""


@dataclass(frozen=True)
class EventAddress:
    """The address at which a driver receives events. ``key``: secret of both sides. ``place``: host and sockets of the
    driver.
    """

    host: str
    port: int
    key: bytes
    place: tuple[str, str]


class EventReceiver:
    """Listens for the events of episodes at an address of this machine; clients must know the key."""

    def __init__(self, host: str) -> None:
        key = secrets.token_bytes(32)
        self._server = socket.create_server((host, 0))
        self.address = EventAddress(host, self._server.getsockname()[1], key, _place())
        self._free = threading.Semaphore(MOST_CONNECTIONS)
        self._closed = False
        threading.Thread(target=self._accept, name="remote-events", daemon=True).start()

    def close(self) -> None:
        """Accept no further episodes."""
        self._closed = True
        self._server.shutdown(socket.SHUT_RDWR)  # ends ``accept``
        self._server.close()

    def _accept(self) -> None:
        while not self._closed:
            try:
                accepted, _ = self._server.accept()
            except OSError:
                time.sleep(RETRY)
                continue
            if self._free.acquire(blocking=False):
                threading.Thread(target=self._receive, args=(accepted,), daemon=True).start()
            else:
                accepted.close()

    def _receive(self, accepted: socket.socket) -> None:
        """Publish the events of a connection whose other end shows that it knows the key."""
        try:
            with (
                suppress(OSError, EOFError, AuthenticationError),
                accepted,
                Connection(os.dup(accepted.fileno())) as connection,
            ):
                _set_timeout(accepted, HANDSHAKE)
                deliver_challenge(connection, self.address.key)
                answer_challenge(connection, self.address.key)
                _set_timeout(accepted, 0)  # an episode may be silent for long
                _publish(connection)
        finally:
            self._free.release()


@contextmanager
def forwarded_events(address: EventAddress | None) -> Iterator[None]:
    """Send the events of this process's executors to a driver that does not see their sockets."""
    ended = threading.Event()
    if address is not None and address.place != _place():
        threading.Thread(target=_forward, args=(address, ended), name="forwarded-events", daemon=True).start()
    try:
        yield
    finally:
        ended.set()


def _place() -> tuple[str, str]:
    return socket.gethostname(), str(socket_folder())


def _set_timeout(connection: socket.socket, seconds: int) -> None:
    """Limit the time that a read from the file descriptor waits, which Python's timeouts do not; 0: no limit."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", seconds, 0))


def _publish(connection: Connection) -> None:
    run: RunEvent | None = None
    shown: WatchedExecution | None = None
    with ExitStack() as stack:
        node = connection.recv_bytes().decode()
        while True:
            try:
                event: Event = from_line(connection.recv_bytes())
            except EventError:
                continue
            if isinstance(event, RunEvent):
                run = replace(event, folder="", source=f"process {event.pid} on {node}")
            elif shown is not None:
                shown.publish(event)
            elif isinstance(event, TreeEvent) and run is not None:
                shown = stack.enter_context(WatchedExecution(run, event, None, refuse))


def _forward(address: EventAddress, ended: threading.Event) -> None:
    """Send until the executor has ended; if the driver does not listen, the episode continues."""
    while not (sockets := list(socket_folder().glob(f"{os.getpid()}-*.sock"))):
        if ended.wait(LOOK):
            return
    with (
        suppress(OSError, EOFError, AuthenticationError),
        Client((address.host, address.port), authkey=address.key) as connection,
    ):
        connection.send_bytes(socket.gethostname().encode())
        for line in ask_events(sockets[0], ("states", "blackboard", "robot", "scan", "log")):
            connection.send_bytes(line)
