"""The twin of an xArm's control box: UFACTORY's private Modbus TCP on port 502, reports on 30001 to 30003.

The frames are those that the vendor's Python SDK (1.18) sends and reads: big-endian integers, little-endian floats.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from hal.api import Arm, Gripper
from hal.twins.tcp_server import TcpTwin, modbus_frames
from hal.twins.world import TwinWorld
from hal.twins.xarm_controller import COLLISION_ERROR, JOINT_LIMIT_ERROR, State, XArmController
from hal.twins.xarm_flange import FlangePose, GripperBus, ToolIO
from hal.twins.xarm_settings import FIRMWARE, XArmSettings

CONTROL_PORT = 502
REPORTS = {30001: (145, 5.0), 30002: (494, 5.0), 30003: (135, 100.0)}
"""Port → length of a report, bytes, and reports per second."""
PRIVATE_PROTOCOLS = (2, 3)
"""Timeouts without and with heartbeats of the client."""
ERROR_FLAG, NOT_READY_FLAG = 0x40, 0x10
LITE6_TYPE = 9
"""The type that xArms report is their number of joints."""


class XArmTwin(TcpTwin):
    """Serves one arm, and its gripper if it has one, on ``address``. Raises OSError if a port is not available."""

    def __init__(self, connection: ConnectionConfig, model: RobotModel, world: TwinWorld, address: str) -> None:
        robot = world.robot
        arm_name = next(name for name in connection.parts if name in model.of(ArmModel))
        gripper_name = next((name for name in connection.parts if name in model.of(GripperModel)), None)
        self._clients: set[socket.socket] = set()
        reports = {port: partial(self._attend_reports, length, rate) for port, (length, rate) in REPORTS.items()}
        super().__init__(address, {CONTROL_PORT: self._attend, **reports})
        self.controller = XArmController(
            world,
            robot.part(arm_name, Arm),
            robot.part(gripper_name, Gripper) if gripper_name else None,
            is_lite6=connection.options.arm == "lite6",
        )
        self._device_type = LITE6_TYPE if self.controller.is_lite6 else self.controller.axes
        self._board = ToolIO(self.controller)
        self._bus = GripperBus(self.controller)
        self._flange = FlangePose(model, arm_name)
        serial = "LI1003" if self.controller.is_lite6 else "XI1304"
        self.settings = XArmSettings.of(model, arm_name, f"{serial}00000000")
        self.faults.add(
            {
                **self.settings.faults(),
                **{f"turn_joint{n + 1}": partial(self.controller.turn, n) for n in range(self.controller.axes)},
                "as_commanded": partial(self.controller.turn, None),
                "protective_stop": lambda: self.controller.trip(COLLISION_ERROR),
                "joint_limit": lambda: self.controller.trip(JOINT_LIMIT_ERROR),
                "released": lambda: self.controller.be_released(),
                "gripper_jam": self.controller.jam,
                "gripper_free": self.controller.unjam,
            }
        )
        self._registers = self._make_registers()

    @property
    def serial_number(self) -> str:
        """Return the serial number of the arm."""
        return self.settings.serial_number

    def _attend(self, client: socket.socket) -> None:
        """Serve one client until it disconnects; a robot comes to rest when its last client disconnects."""
        self._clients.add(client)
        try:
            for frame in modbus_frames(self.received(client)):
                self._answer(client, frame)
        finally:
            self._clients.discard(client)
            if not self._clients:
                self.controller.halt()

    def _answer(self, client: socket.socket, frame: bytes) -> None:
        transaction, protocol, length = struct.unpack_from(">HHH", frame)
        if protocol not in PRIVATE_PROTOCOLS or length < 1:
            return  # a heartbeat
        register, data = frame[6], frame[7:]
        answer = self._registers.get(register, _ignored)(data)
        controller = self.controller
        flags = (ERROR_FLAG if controller.error else 0) | (NOT_READY_FLAG if controller.state == State.STOPPED else 0)
        self.send(client, struct.pack(">HHHBB", transaction, protocol, len(answer) + 2, register, flags) + answer)

    def _attend_reports(self, length: int, rate: float, client: socket.socket) -> None:
        due = time.monotonic()
        while True:
            self.send(client, self._report(length))
            due = max(due + 1.0 / rate, time.monotonic())
            time.sleep(due - time.monotonic())

    def _report(self, length: int) -> bytes:
        controller, reading = self.controller, self.controller.reading
        frame = struct.pack(">IBH", length, controller.mode << 4 | controller.state, controller.commands_left)
        frame += _seven(reading.positions) + self._pose() + _seven(reading.efforts)
        if length > 135:
            frame += bytes([0, 0xFF if controller.enabled else 0, controller.error, controller.warning])
            settings = self.settings
            frame += _floats(*settings.tool_offset, *settings.load) + bytes([3, 3]) + _floats(*settings.gravity)
        if length > 145:
            frame += bytes([controller.axes, self._device_type, 0, 0, 0, 0]) + FIRMWARE.encode().ljust(30, b"\0")
            frame += _floats(1000.0, 1.0, 50000.0, 0.1, 1000.0, 20.0, 0.01, 20.0, 0.01, 3.14, 2.3, 2.7)
        return frame.ljust(length, b"\0")

    def _make_registers(self) -> dict[int, Callable[[bytes], bytes]]:
        controller, bus, board = self.controller, self._bus, self._board
        axes = controller.axes
        settings = self.settings
        version = f"{axes},{self._device_type},{settings.serial_number[:6]},AC1304,{FIRMWARE}".encode().ljust(40, b"\0")

        def done(action: Callable[[bytes], object]) -> Callable[[bytes], bytes]:
            def answer(data: bytes) -> bytes:
                action(data)
                return b""

            return answer

        return {
            1: lambda data: version,
            2: lambda data: f"{settings.serial_number}\0AC130400000000".encode().ljust(40, b"\0"),
            11: done(lambda data: controller.enable(bool(data[1]))),
            12: done(lambda data: controller.set_state(data[0])),
            13: lambda data: bytes([controller.state]),
            14: lambda data: struct.pack(">H", controller.commands_left),
            15: lambda data: bytes([controller.error, controller.warning]),
            16: done(lambda data: controller.clear_error()),
            19: done(lambda data: controller.set_mode(data[0])),
            23: done(self._move_joint),
            24: done(self._move_joint),
            29: done(lambda data: controller.servo(np.array(struct.unpack("<7f", data[:28])[:axes]))),
            35: done(lambda data: setattr(settings, "tool_offset", struct.unpack("<6f", data[:24]))),
            36: done(settings.set_load),
            41: lambda data: self._pose(),
            42: self._joint_states,
            47: done(lambda data: setattr(controller, "reduced_tool_speed", struct.unpack("<f", data)[0])),
            48: done(lambda data: setattr(controller, "reduced_joint_speed", struct.unpack("<f", data)[0])),
            49: lambda data: bytes([controller.reduced]),
            50: done(lambda data: setattr(controller, "reduced", bool(data[0]))),
            124: bus.request,
            127: done(board.write),
            128: board.read,
        }

    def _move_joint(self, data: bytes) -> None:
        values = struct.unpack("<10f", data[:40])
        self.controller.move(np.array(values[: self.controller.axes]), values[7])

    def _joint_states(self, data: bytes) -> bytes:
        reading = self.controller.reading
        columns = (reading.positions, reading.velocities, reading.efforts)
        return b"".join(_seven(column) for column in columns[: (data[0] & 0x0F) if data else 1])

    def _pose(self) -> bytes:
        return _floats(*self.settings.tool_pose(self._flange.millimetres(self.controller.reading.positions)))


def _ignored(data: bytes) -> bytes:
    """Return a setting that has no effect in the twin: answered as done."""
    return b""


def _floats(*values: float) -> bytes:
    return struct.pack(f"<{len(values)}f", *values)


def _seven(values: np.ndarray) -> bytes:
    return _floats(*values, *[0.0] * (7 - len(values)))
