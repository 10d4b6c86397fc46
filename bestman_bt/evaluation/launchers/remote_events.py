"""Live events of episodes on other machines: the driver publishes them, so that its monitors show those runs."""

from __future__ import annotations

import os
import secrets
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, Listener

from bestman_bt.monitor.control_client import ask_events, socket_folder
from bestman_bt.monitor.watched import WatchedExecution, refuse
from bestman_bt.records.events import Event, EventError, RunEvent, TreeEvent, from_line

LOOK = 0.05
"""Seconds between two looks for the executor of an episode."""


@dataclass(frozen=True)
class EventAddress:
    """Where a driver receives events. ``key``: secret of both sides. ``place``: host and sockets of the driver."""

    host: str
    port: int
    key: bytes
    place: tuple[str, str]


class EventReceiver:
    """Listens for the events of episodes at an address of this machine; who connects must know the key."""

    def __init__(self, host: str) -> None:
        key = secrets.token_bytes(32)
        self._listener = Listener((host, 0), authkey=key)
        self.address = EventAddress(host, self._listener.address[1], key, _place())
        self._closed = False
        threading.Thread(target=self._accept, name="remote-events", daemon=True).start()

    def close(self) -> None:
        """Take no further episodes."""
        self._closed = True
        with suppress(OSError, EOFError):
            socket.create_connection((self.address.host, self.address.port), timeout=1.0).close()  # ends ``accept``
        self._listener.close()

    def _accept(self) -> None:
        while not self._closed:
            with suppress(OSError, EOFError, AuthenticationError):
                connection = self._listener.accept()
                threading.Thread(target=_publish, args=(connection,), daemon=True).start()


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


def _publish(connection: Connection) -> None:
    run: RunEvent | None = None
    shown: WatchedExecution | None = None
    with connection, ExitStack() as stack, suppress(EOFError, OSError):
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
    """Send until the executor has ended; the episode goes on where the driver does not listen."""
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
