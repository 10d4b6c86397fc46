"""RTDE, the real-time data exchange of a UR controller on port 30004 (protocol version 2)."""

from __future__ import annotations

import re
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hal.twins.faults import Faults

FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}
_TYPES: tuple[tuple[str, str], ...] = (
    (r"(actual|target)_(q|qd|qdd|current|moment)|actual_current_as_torque|joint_control_output", "VECTOR6D"),
    (r"(actual|target)_TCP_(pose|speed)|actual_TCP_force|ft_raw_wrench|external_force_torque", "VECTOR6D"),
    (r"joint_temperatures|actual_joint_voltage|payload_inertia", "VECTOR6D"),
    (r"actual_tool_accelerometer|payload_cog|elbow_position|elbow_velocity", "VECTOR3D"),
    (r"joint_mode", "VECTOR6INT32"),
    (r"robot_mode|safety_mode|(in|out)put_int_register_\d+", "INT32"),
    (r"actual_digital_(in|out)put_bits", "UINT64"),
    (r"runtime_state|robot_status_bits|safety_status_bits|speed_slider_mask|output_bit_registers\w+", "UINT32"),
    (r"(standard|configurable|tool)_digital_output(_mask)?|standard_analog_output_(mask|type)", "UINT8"),
    (r"(in|out)put_bit_register_\d+", "BOOL"),
    (r"(in|out)put_double_register_\d+|timestamp|speed_scaling|target_speed_fraction|payload", "DOUBLE"),
    (r"actual_(execution_time|momentum|main_voltage|robot_voltage|robot_current)", "DOUBLE"),
    (r"standard_analog_(in|out)put_?[01]|speed_slider_fraction", "DOUBLE"),
)


def field_type(name: str) -> str | None:
    """Return the RTDE type of a field, None if there is no such field."""
    return next((kind for pattern, kind in _TYPES if re.fullmatch(pattern, name)), None)


class Recipe:
    """An agreed list of fields. The controller refuses one with unknown fields."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.types = tuple(field_type(name) or "NOT_FOUND" for name in names)
        formats = [FORMATS.get(kind, "") for kind in self.types]
        self._sizes = [int(form[0]) if form[:1].isdigit() else 1 for form in formats]
        self._struct = struct.Struct(">" + "".join(formats))

    @property
    def known(self) -> bool:
        """Return whether the controller has all of its fields."""
        return "NOT_FOUND" not in self.types

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """Return the packed values of its fields; missing ones are zero."""
        numbers: list[Any] = []
        for name, size in zip(self.names, self._sizes, strict=True):
            if size == 1:
                numbers.append(values.get(name, 0))
            else:
                numbers.extend(values.get(name, (0,) * size))
        return self._struct.pack(*numbers)

    def unpack(self, data: bytes) -> dict[str, Any]:
        """Return field → value, a tuple for vectors. Raises struct.error for a wrong length."""
        numbers = iter(self._struct.unpack(data))
        values: dict[str, Any] = {}
        for name, size in zip(self.names, self._sizes, strict=True):
            values[name] = next(numbers) if size == 1 else tuple(next(numbers) for _ in range(size))
        return values


VERSION, CONTROLLER_VERSION, DATA = ord("V"), ord("v"), ord("U")
SETUP_OUTPUTS, SETUP_INPUTS, START, PAUSE = ord("O"), ord("I"), ord("S"), ord("P")
PROTOCOL = 2
POLYSCOPE = (5, 11, 0, 108249)
OUTPUT_RECIPE = 1


class RtdeSession:
    """The session of one client. ``read``: returns all output fields; ``write(due, all)``: applies inputs that arrived
    together in one cycle when due, also on a delayed machine.

    ``owners``: input field → the session that has set it up, shared by all sessions: a field has one writer.
    """

    def __init__(
        self,
        client: socket.socket,
        faults: Faults,
        read: Callable[[], Mapping[str, Any]],
        write: Callable[[float, Sequence[Mapping[str, Any]]], None],
        owners: dict[str, RtdeSession],
    ) -> None:
        self._client, self._faults, self._read, self._write = client, faults, read, write
        self._owners = owners
        self._inputs: dict[int, Recipe] = {}
        self._output: Recipe | None = None
        self._rate = 125.0
        self._sending = threading.Lock()
        self._streaming = threading.Event()

    def serve(self) -> None:
        """Answer until the client closes."""
        buffer = b""
        try:
            while chunk := self._client.recv(65536):
                if self._faults.wire.silent:
                    continue
                buffer += chunk
                data: list[Mapping[str, Any]] = []
                while len(buffer) >= 3 and len(buffer) >= (size := int.from_bytes(buffer[:2], "big")):
                    command, payload, buffer = buffer[2], buffer[3:size], buffer[size:]
                    if command == DATA:
                        if recipe := self._inputs.get(payload[0]):
                            data.append(recipe.unpack(payload[1:]))
                    else:
                        self._answer(command, payload)
                if data:
                    self._write(time.monotonic() + self._faults.wire.delay, data)
        finally:
            self._streaming.clear()
            for name in [name for name, owner in self._owners.items() if owner is self]:
                del self._owners[name]

    def _answer(self, command: int, payload: bytes) -> None:
        if command == VERSION:
            self._send(command, bytes([struct.unpack(">H", payload)[0] == PROTOCOL]))
        elif command == CONTROLLER_VERSION:
            self._send(command, struct.pack(">4I", *POLYSCOPE))
        elif command == SETUP_OUTPUTS:
            self._rate = struct.unpack_from(">d", payload)[0]
            self._output = Recipe(_names(payload[8:]))
            self._send(command, bytes([OUTPUT_RECIPE]) + ",".join(self._output.types).encode())
        elif command == SETUP_INPUTS:
            recipe = Recipe(_names(payload))
            taken = [self._owners.setdefault(name, self) is not self for name in recipe.names]
            number = len(self._inputs) + 1 if recipe.known and not any(taken) else 0
            if number:
                self._inputs[number] = recipe
            types = ("IN_USE" if used else kind for used, kind in zip(taken, recipe.types, strict=True))
            self._send(command, bytes([number]) + ",".join(types).encode())
        elif command == START:
            ready = self._output is not None and self._output.known
            self._send(command, bytes([ready]))
            if ready and not self._streaming.is_set():
                self._streaming.set()
                threading.Thread(target=self._stream, name="rtde stream", daemon=True).start()
        elif command == PAUSE:
            self._streaming.clear()
            self._send(command, b"\1")

    def _stream(self) -> None:
        """Stream data packages at the agreed rate; a delay of the wire holds each one back, the rate stays."""
        due, underway = time.monotonic(), deque[tuple[float, bytes]]()
        recipe = self._output
        assert recipe is not None
        try:
            while self._streaming.is_set():
                now, wire = time.monotonic(), self._faults.wire
                underway.append((now + wire.delay, bytes([OUTPUT_RECIPE]) + recipe.pack(self._read())))
                while underway and (wire.silent or underway[0][0] <= now):
                    _, package = underway.popleft()
                    if not wire.silent:
                        self._send(DATA, package)
                due = max(due + 1.0 / self._rate, now)
                time.sleep(max(0.0, due - time.monotonic()))
        except OSError:
            self._streaming.clear()

    def _send(self, command: int, payload: bytes) -> None:
        with self._sending:
            self._client.sendall(struct.pack(">HB", 3 + len(payload), command) + payload)


def _names(payload: bytes) -> list[str]:
    return [name for name in payload.decode("ascii").split(",") if name]
