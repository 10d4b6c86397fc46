"""The two protocols of a Robotiq 2F gripper: the URCap's socket on port 63352, and Modbus TCP. Values are 0 to 255."""

from __future__ import annotations

import contextlib
import logging
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from typing_extensions import override

URCAP_PORT, MODBUS_PORT = 63352, 502
ACTIVATE, GO = 1 << 0, 1 << 3


@dataclass(frozen=True)
class RobotiqStatus:
    """The gripper's status registers.

    ``activation``: 3 once it is active. ``object``: 0 moving, 1 and 2 stopped by an object while opening and closing, 3
    at its target; only valid while it ``goes`` to its target. ``echo``: the last requested position; ``position``: 0
    open, 255 closed.
    """

    activation: int
    object: int
    fault: int
    echo: int
    position: int
    goes: bool


class RobotiqWire(ABC):
    """A request–reply connection to one gripper, for one thread at a time. Raises OSError without a reply."""

    @abstractmethod
    def open(self) -> None:
        """Connect. Raises OSError if that fails."""

    @abstractmethod
    def close(self) -> None:
        """Close the connection; idempotent."""

    @abstractmethod
    def status(self) -> RobotiqStatus:
        """Return the current status."""

    @abstractmethod
    def reset(self) -> None:
        """Deactivate the gripper, which clears its fault."""

    @abstractmethod
    def activate(self) -> None:
        """Start the activation; the fingers may close and open meanwhile."""

    @abstractmethod
    def go(self, position: int, speed: int, force: int) -> None:
        """Send a target position."""

    @abstractmethod
    def halt(self) -> None:
        """Stop the fingers at their current position."""


class URCapWire(RobotiqWire):
    """Lines of text, ``SET POS 100 SPE 255`` and ``GET OBJ``, that the gripper's URCap accepts at the UR's address."""

    def __init__(self, address: str, port: int, timeout: float) -> None:
        self._address, self._timeout = (address, port), timeout
        self._socket: socket.socket | None = None
        self._buffer = b""

    @override
    def open(self) -> None:
        self._socket = socket.create_connection(self._address, self._timeout)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer = b""

    @override
    def close(self) -> None:
        wire, self._socket = self._socket, None
        if wire is not None:
            wire.close()

    def status(self) -> RobotiqStatus:
        """Return the status from six requests, sent together."""
        names = ("STA", "OBJ", "FLT", "PRE", "POS", "GTO")
        self._send("".join(f"GET {name}\n" for name in names))
        state, felt, fault, echo, position, goes = (self._value(name) for name in names)
        return RobotiqStatus(state, felt, fault, echo, position, bool(goes))

    @override
    def reset(self) -> None:
        self._set(ACT=0, ATR=0)

    @override
    def activate(self) -> None:
        self._set(ACT=1)

    @override
    def go(self, position: int, speed: int, force: int) -> None:
        self._set(POS=position, SPE=speed, FOR=force, GTO=1)

    @override
    def halt(self) -> None:
        self._set(GTO=0)

    def _set(self, **values: int) -> None:
        self._send("SET " + " ".join(f"{name} {value}" for name, value in values.items()) + "\n")
        self._expect(b"ack")

    def _value(self, name: str) -> int:
        line = self._line()
        key, _, value = line.partition(" ")
        if key != name or not value.strip().isdigit():
            raise OSError(f"the gripper answered the request for {name} with {line!r}")
        return int(value)

    def _send(self, text: str) -> None:
        if self._socket is None:
            raise OSError("the connection is closed")
        self._socket.sendall(text.encode("ascii"))

    def _receive(self) -> None:
        if self._socket is None:
            raise OSError("the connection is closed")
        chunk = self._socket.recv(1024)
        if not chunk:
            raise OSError("the gripper closed the connection")
        self._buffer += chunk

    def _line(self) -> str:
        while b"\n" not in self._buffer:
            self._receive()
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line.decode("ascii", "replace").strip()

    def _expect(self, word: bytes) -> None:
        """Read an acknowledgement, which some versions end with a line feed and some do not."""
        while len(self._buffer.lstrip(b"\r\n")) < len(word):
            self._receive()
        self._buffer = self._buffer.lstrip(b"\r\n")
        if not self._buffer.startswith(word):
            raise OSError(f"the gripper refused a command: {self._buffer[:40]!r}")
        self._buffer = self._buffer[len(word) :].lstrip(b"\r\n")


class ModbusWire(RobotiqWire):
    """Three command and three status registers of two bytes each, through pymodbus."""

    def __init__(
        self,
        load: Callable[[str], ModuleType],
        address: str,
        port: int,
        timeout: float,
        device: int,
        command_register: int,
        status_register: int,
    ) -> None:
        self._load, self._address, self._port, self._timeout = load, address, port, timeout
        self._device, self._command_register, self._status_register = device, command_register, status_register
        self._client: Any = None
        self._bytes = [0, 0, 0, 0, 0, 0]

    @override
    def open(self) -> None:
        client = self._load("pymodbus.client").ModbusTcpClient
        logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)  # it would tell the address
        self._client = client(self._address, port=self._port, timeout=self._timeout, retries=0)
        if not self._client.connect():
            raise OSError("no device answers")

    @override
    def close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with contextlib.suppress(OSError):
                client.close()

    def status(self) -> RobotiqStatus:
        """Read three registers at once."""
        answer = self._ask(
            lambda client: client.read_input_registers(self._status_register, count=3, device_id=self._device)
        )
        state, (fault, echo) = answer.registers[0] >> 8, divmod(answer.registers[1], 256)
        position = answer.registers[2] >> 8
        return RobotiqStatus(state >> 4 & 3, state >> 6 & 3, fault & 15, echo, position, bool(state & GO))

    @override
    def reset(self) -> None:
        self._bytes = [0, 0, 0, 0, 0, 0]
        self._write()

    @override
    def activate(self) -> None:
        self._bytes[0] = ACTIVATE
        self._write()

    @override
    def go(self, position: int, speed: int, force: int) -> None:
        self._bytes = [ACTIVATE | GO, 0, 0, position, speed, force]
        self._write()

    @override
    def halt(self) -> None:
        self._bytes[0] = ACTIVATE
        self._write()

    def _write(self) -> None:
        values = [high << 8 | low for high, low in zip(self._bytes[::2], self._bytes[1::2], strict=True)]
        self._ask(lambda client: client.write_registers(self._command_register, values, device_id=self._device))

    def _ask(self, question: Callable[[Any], Any]) -> Any:
        if self._client is None:
            raise OSError("the connection is closed")
        modbus_error = self._load("pymodbus.exceptions").ModbusException
        try:
            answer = question(self._client)
        except modbus_error as error:
            raise OSError("no answer over Modbus") from error
        if answer.isError():
            raise OSError(f"the gripper refused a Modbus request: {answer}")
        return answer
