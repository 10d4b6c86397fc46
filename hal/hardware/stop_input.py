"""An external stop signal by UDP, for example from a button, a scanner, a PLC or another robot."""

from __future__ import annotations

import socket
import time

from bestman_bt.robot_model.connection_config import StopInputConfig, host_and_port
from hal.parts.part_connection import ConnectionFailedError

RUN, STOP = b"run", b"stop"
"""Contents of the datagrams."""
LONGEST = 64
BEGINNING = 2.0
"""Seconds within which ``run`` has to arrive when the robot connects."""


class StopInput:
    """Receives datagrams ``run`` or ``stop``. Silence counts as a stop, so that a broken wire stops the robot.

    ``look`` is called every few milliseconds, by one thread.
    """

    def __init__(self, config: StopInputConfig) -> None:
        self._config = config
        self._socket: socket.socket | None = None
        self._last = b""
        self._heard_at = -1e9

    def open(self) -> None:
        """Listen, and wait for the first ``run``. Raises ConnectionFailedError if none arrives."""
        host, port = host_and_port(self._config.address)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = heard = socket.socket(family, socket.SOCK_DGRAM)
        heard.setblocking(False)
        try:
            heard.bind((host, port))
        except OSError as error:
            self.close()
            raise ConnectionFailedError(
                f"the stop input cannot listen at {self._config.address}: {error.strerror or error}"
            ) from error
        deadline = time.monotonic() + BEGINNING
        while (objection := self.look()) is not None:
            if time.monotonic() > deadline:
                self.close()
                raise ConnectionFailedError(f"{objection}, and motion requires its 'run'")
            time.sleep(0.01)

    def close(self) -> None:
        """Stop listening; idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._last, self._heard_at = b"", -1e9

    def look(self) -> str | None:
        """Read pending input; return the reason to stop as text, or None. No ``stop`` is missed."""
        stopped = False
        while self._socket is not None:
            try:
                word = self._socket.recv(LONGEST).strip().lower()
            except OSError:  # nothing has come
                break
            if word in (RUN, STOP):
                self._last, self._heard_at = word, time.monotonic()
                stopped = stopped or word == STOP
        if stopped or self._last == STOP:
            return "the stop input reports stop"
        if time.monotonic() - self._heard_at > self._config.silence:
            return f"the stop input has sent nothing for {self._config.silence:g} s"
        return None
