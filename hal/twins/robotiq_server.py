"""The twin of a Robotiq 2F gripper: its URCap's socket on port 63352, or Modbus TCP on port 502."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator

from bestman_bt.robot_model import GripperModel, RobotModel
from bestman_bt.robot_model.connection_config import ConnectionConfig
from hal.api import Gripper
from hal.twins.faults import Faults
from hal.twins.robotiq_gripper import RobotiqGripper
from hal.twins.tcp_server import TcpServer
from hal.twins.world import TwinWorld

URCAP_PORT, MODBUS_PORT = 63352, 502
READ_INPUTS, WRITE_REGISTERS = 4, 16
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2


class RobotiqTwin:
    """Serves one gripper on ``address``, by the connection's protocol. OSError where the port cannot be had."""

    def __init__(self, connection: ConnectionConfig, model: RobotModel, world: TwinWorld, address: str) -> None:
        name = next(name for name in connection.parts if name in model.of(GripperModel))
        self._options = connection.options
        modbus = self._options.protocol == "modbus"
        port = connection.port or (MODBUS_PORT if modbus else URCAP_PORT)
        self._server = TcpServer(address, port, self._attend_modbus if modbus else self._attend_urcap)
        self.gripper = RobotiqGripper(
            world,
            world.robot.part(name, Gripper),
        )
        self.faults = Faults()
        self.faults.offer({"gripper_jam": self.gripper.jam, "gripper_free": self.gripper.unjam})

    def start(self) -> None:
        """Accept clients."""
        self._server.start()

    def close(self) -> None:
        """Close the port."""
        self._server.close()

    def _received(self, client: socket.socket) -> Iterator[bytes]:
        """What comes over the wire, with the faults that it has."""
        while chunk := client.recv(4096):
            if not self.faults.wire.silent:
                time.sleep(self.faults.wire.delay)
                yield chunk

    def _attend_urcap(self, client: socket.socket) -> None:
        buffer = b""
        for chunk in self._received(client):
            buffer += chunk
            *lines, buffer = buffer.split(b"\n")
            answers = b"".join(self._answer_line(line.decode("ascii", "replace").split()) for line in lines)
            if not self.faults.wire.silent:
                client.sendall(answers)

    def _answer_line(self, words: list[str]) -> bytes:
        match words:
            case ["GET", name] if name in self.gripper.variables:
                return f"{name} {self.gripper.variables[name]}\n".encode()
            case ["SET", *pairs] if len(pairs) % 2 == 0 and all(value.isdigit() for value in pairs[1::2]):
                self.gripper.command(dict(zip(pairs[::2], map(int, pairs[1::2]), strict=True)))
                return b"ack"
        return b"?\n"

    def _attend_modbus(self, client: socket.socket) -> None:
        buffer = b""
        for chunk in self._received(client):
            buffer += chunk
            while len(buffer) >= 6 and len(buffer) >= (size := 6 + int.from_bytes(buffer[4:6], "big")):
                frame, buffer = buffer[:size], buffer[size:]
                transaction, unit, function = frame[:2], frame[6], frame[7]
                answer = self._answer_frame(function, frame[8:])
                head = transaction + struct.pack(">HHB", 0, len(answer) + 1, unit)
                if not self.faults.wire.silent and unit == self._options.device:
                    client.sendall(head + answer)

    def _answer_frame(self, function: int, data: bytes) -> bytes:
        address, count = struct.unpack_from(">HH", data)
        if function not in (READ_INPUTS, WRITE_REGISTERS):
            return bytes([function | 0x80, ILLEGAL_FUNCTION])
        reads = function == READ_INPUTS
        if address != (self._options.status_register if reads else self._options.command_register) or count > 3:
            return bytes([function | 0x80, ILLEGAL_ADDRESS])
        if reads:
            told = self.gripper.variables
            state = told["ACT"] | told["GTO"] << 3 | told["STA"] << 4 | told["OBJ"] << 6
            values = bytes([state, 0, told["FLT"], told["PRE"], told["POS"], 0])[: 2 * count]
            return bytes([function, len(values)]) + values
        action, _, _, position, speed, force = data[5:11].ljust(6, b"\0")
        values_by_name = {"ACT": action & 1, "GTO": action >> 3 & 1, "SPE": speed, "FOR": force}
        if values_by_name["GTO"]:
            values_by_name["POS"] = position
        self.gripper.command(values_by_name)
        return bytes([function]) + data[:4]
