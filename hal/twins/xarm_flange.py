"""The board in an xArm's tool flange: the speed of its bus, and digital outputs, which drive a Lite 6's gripper."""

from __future__ import annotations

import struct
import threading

import numpy as np
import pinocchio
from numpy.typing import NDArray

from bestman_bt.robot_model.model import ArmModel, RobotModel
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
        """Answer one Modbus request; a missing device does not reply."""
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


class FlangePose:
    """Forward kinematics of one arm from its ``base_frame`` to the link of its last joint."""

    def __init__(self, model: RobotModel, arm: str) -> None:
        description = model.of(ArmModel)[arm]
        self._model = pinocchio.buildModelFromXML(model.urdf)
        self._data = self._model.createData()
        self._lock = threading.Lock()
        self._slots = [self._model.joints[self._model.getJointId(name)].idx_q for name in description.joint_names]
        self._base = self._model.getFrameId(description.base_frame)
        self._last = self._model.getJointId(description.joint_names[-1])

    def millimetres(self, positions: NDArray[np.float64]) -> tuple[float, ...]:
        """Return x, y, z in millimetres; roll, pitch, yaw in radians."""
        q = pinocchio.neutral(self._model)
        q[self._slots] = positions
        with self._lock:
            pinocchio.framesForwardKinematics(self._model, self._data, q)
            flange = self._data.oMf[self._base].actInv(self._data.oMi[self._last])
        return (*(1e3 * flange.translation).tolist(), *pinocchio.rpy.matrixToRpy(flange.rotation).tolist())


BAUD_RATE, OUTPUTS, SET_OUTPUTS = 0x0A0B, 0x0A18, 0x0A15
BAUD_RATE_2M = 11
"""Index of 2,000,000 baud, which the gripper on the bus needs, in the vendor's list."""
OPEN, CLOSE = 0b01, 0b10


class ToolIO:
    """Registers by ``host, address, value, …``; values are written as little-endian floats."""

    def __init__(self, controller: XArmController) -> None:
        self._controller = controller
        self._outputs = 0

    def read(self, data: bytes) -> bytes:
        """Return the value of a register."""
        (address,) = struct.unpack_from(">H", data, 1)
        return struct.pack(">i", {BAUD_RATE: BAUD_RATE_2M, OUTPUTS: self._outputs}.get(address, 0))

    def write(self, data: bytes) -> None:
        """Set the outputs selected by the high byte; other settings have no effect in the twin."""
        (address,), (value,) = struct.unpack_from(">H", data, 1), struct.unpack_from("<f", data, 3)
        if address != SET_OUTPUTS:
            return
        named, on = int(value) >> 8, int(value) & 0xFF
        before, self._outputs = self._outputs, self._outputs & ~named | on & named
        driven = self._outputs & (OPEN | CLOSE)
        if self._controller.is_lite6 and driven != before & (OPEN | CLOSE):
            self._controller.power_gripper({OPEN: 1.0, CLOSE: 0.0}.get(driven))
