"""The board in an xArm's tool flange: the speed of its bus, and digital outputs, which drive a Lite 6's gripper."""

from __future__ import annotations

import struct

from hal.twins.xarm_controller import XArmController

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
        """The value of a register."""
        (address,) = struct.unpack_from(">H", data, 1)
        return struct.pack(">i", {BAUD_RATE: BAUD_RATE_2M, OUTPUTS: self._outputs}.get(address, 0))

    def write(self, data: bytes) -> None:
        """Outputs are set where the high byte names them; other settings have no effect in the twin."""
        (address,), (value,) = struct.unpack_from(">H", data, 1), struct.unpack_from("<f", data, 3)
        if address != SET_OUTPUTS:
            return
        named, on = int(value) >> 8, int(value) & 0xFF
        before, self._outputs = self._outputs, self._outputs & ~named | on & named
        driven = self._outputs & (OPEN | CLOSE)
        if self._controller.is_lite6 and driven != before & (OPEN | CLOSE):
            self._controller.power_gripper({OPEN: 1.0, CLOSE: 0.0}.get(driven))
