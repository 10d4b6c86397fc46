"""The bus on an xArm's tool flange: the gripper's Modbus RTU registers, passed through the control box."""

from __future__ import annotations

import struct

from hal.twins.xarm_controller import XArmController

GRIPPER = 8
READ, WRITE = 0x03, 0x10
STATUS, ERROR_CODE, ENABLE, MODE, RESET_ERROR = 0x0000, 0x000F, 0x0100, 0x0101, 0x0109
SPEED, TARGET, POSITION = 0x0303, 0x0700, 0x0702
VERSION = {0x0801: 3, 0x0802: 4, 0x0803: 3}


class GripperBus:
    """Answers frames ``host, device, function, register, count, …``; without checksum, as the control box does."""

    def __init__(self, controller: XArmController) -> None:
        self._controller = controller

    def request(self, data: bytes) -> bytes:
        """One Modbus request; a device that is not there answers nothing."""
        host, device, function, register, count = struct.unpack_from(">BBBHH", data)
        if device != GRIPPER or self._controller.is_lite6:
            return bytes([host])
        if function == WRITE:
            self._write(register, data[8 : 8 + 2 * count])
            return data[:7]
        values = self._read(register).to_bytes(2 * count, "big", signed=True)
        return bytes([host, device, function, 2 * count]) + values

    def _read(self, register: int) -> int:
        controller = self._controller
        if register == POSITION:
            return controller.reading.pulses
        if register == ERROR_CODE:
            return controller.gripper_error
        if register == STATUS:
            return 0
        return VERSION.get(register, 0)

    def _write(self, register: int, value: bytes) -> None:
        controller = self._controller
        number = int.from_bytes(value, "big", signed=True)
        if register == TARGET:
            controller.move_gripper(number)
        elif register == SPEED:
            controller.gripper_turns = number
        elif register == ENABLE:
            controller.gripper_enabled = bool(number)
        elif register == RESET_ERROR:
            controller.gripper_error = 0
