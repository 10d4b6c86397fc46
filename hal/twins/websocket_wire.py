"""The server's side of one websocket (RFC 6455) over a socket of ``TcpServer``."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator

from bestman_bt.extras import install_command
from hal.twins.errors import TwinError

try:
    from websockets.frames import Frame, Opcode
    from websockets.http11 import Request
    from websockets.protocol import State
    from websockets.server import ServerProtocol
except ImportError as error:
    raise TwinError(
        f"the twin of a rosbridge needs the package 'websockets': {install_command('rosbridge')}"
    ) from error

CHUNK = 65536


class WebSocketWire:
    """``messages`` in one thread, ``send`` from any. ``wait``: called before the handshake is answered; may block."""

    def __init__(self, client: socket.socket, wait: Callable[[], None]) -> None:
        self._client, self._wait = client, wait
        self._protocol = ServerProtocol(max_size=None)
        self._lock = threading.Lock()

    def messages(self) -> Iterator[str]:
        """Texts that come, until the client closes or is gone."""
        parts: list[bytes] = []
        while self._protocol.state is not State.CLOSED and (data := self._client.recv(CHUNK)):
            with self._lock:
                self._protocol.receive_data(data)
                events = self._protocol.events_received()
                self._flush()  # pongs, and the answer to a close
            for event in events:
                if isinstance(event, Request):
                    self._wait()
                    with self._lock:
                        self._protocol.send_response(self._protocol.accept(event))
                        self._flush()
                elif isinstance(event, Frame) and event.opcode in (Opcode.TEXT, Opcode.BINARY, Opcode.CONT):
                    parts.append(bytes(event.data))
                    if event.fin:
                        yield b"".join(parts).decode("utf-8")
                        parts.clear()

    def send(self, text: bytes) -> None:
        """Send a text; OSError where the client is gone."""
        with self._lock:
            if self._protocol.state is State.OPEN:
                self._protocol.send_text(text)
                self._flush()

    def _flush(self) -> None:
        for data in self._protocol.data_to_send():
            if data:
                self._client.sendall(data)
            else:  # the end of what is sent
                self._client.shutdown(socket.SHUT_WR)
