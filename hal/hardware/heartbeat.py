"""Heartbeats between two processes: those of ZeroMQ (ZMTP 3.1, PING and PONG). A thread of the library sends them
without the interpreter's lock: a process that computes for seconds answers; one that is stopped (SIGSTOP, a debugger),
swapped out or dead does not. A Python program that waits (for example at a pdb breakpoint) counts as alive.
"""

from __future__ import annotations

import secrets
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from bestman_bt.runtime_folder import runtime_folder
from hal.hardware.control_loop import take_real_time_priority

PRIORITY = 2
"""Real-time priority, if the system allows it, so that a busy machine does not look like a dead process."""
RECONNECT_PERIOD = 20
"""Milliseconds between attempts to reconnect to a silent end."""


class Heartbeat:
    """One end of a mutual watchdog between two processes. ``address``: address of the other end; empty: this is the
    first one. ``longest_silence``: seconds without a heartbeat after which the other end counts as silent; the next
    heartbeat ends the silence. Thread-safe.
    """

    def __init__(self, longest_silence: float, address: str = "") -> None:
        self.longest_silence = longest_silence
        self._file = None if address else runtime_folder() / f"heartbeat-{secrets.token_hex(6)}"
        self.address = address or str(self._file)
        self._lock = threading.Lock()
        self._met = False
        self._silent_since: float | None = None
        with ThreadPoolExecutor(1, "heartbeat") as thread:  # whose priority the library's thread gets
            thread.submit(self._open).result()

    @property
    def silence(self) -> float:
        """Seconds since the other end was detected as silent; 0 while it answers, and before its first answer."""
        with self._lock:
            self._take_events()
            return time.monotonic() - self._silent_since if self._silent_since is not None else 0.0

    @property
    def met(self) -> bool:
        """Return whether the other end has ever answered."""
        with self._lock:
            self._take_events()
            return self._met

    def close(self) -> None:
        """Stop the heartbeat; idempotent."""
        with self._lock:
            if not self._context.closed:
                self._socket.disable_monitor()
                self._events.close(0)
                self._context.destroy(0)
        Path(self.address).unlink(missing_ok=True)  # of whichever end is the last

    def _open(self) -> None:
        import zmq

        take_real_time_priority(PRIORITY)
        self._context = zmq.Context()
        socket: Any = self._context.socket(zmq.ROUTER if self._file is not None else zmq.DEALER)
        period = max(1, int(1000 * self.longest_silence / 4))
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_PERIOD)
        socket.setsockopt(zmq.HEARTBEAT_IVL, period)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3 * period)  # after the PING that was not answered
        self._answers, silent = zmq.EVENT_HANDSHAKE_SUCCEEDED, zmq.EVENT_DISCONNECTED
        self._socket, self._events = socket, socket.get_monitor_socket(self._answers | silent)
        if self._file is not None:
            socket.bind(f"ipc://{self.address}")
        else:
            socket.connect(f"ipc://{self.address}")

    def _take_events(self) -> None:
        from zmq.utils.monitor import recv_monitor_message

        while not self._context.closed and self._events.poll(0):
            if recv_monitor_message(self._events)["event"] == self._answers:
                self._met, self._silent_since = True, None
            elif self._silent_since is None:
                self._silent_since = time.monotonic()
