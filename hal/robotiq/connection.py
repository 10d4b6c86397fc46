"""Robotiq 2F grippers over their URCap's socket or Modbus TCP."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from bestman_bt.robot_model import GripperModel
from hal.api import Failure, Part
from hal.hardware import Connection
from hal.parts import CommandedGripper
from hal.robotiq.channel import RobotiqChannel
from hal.robotiq.options import RobotiqOptions
from hal.robotiq.wire import MODBUS_PORT, URCAP_PORT, ModbusWire, RobotiqWire, URCapWire


class RobotiqConnection(Connection):
    """One gripper. It is activated when connected, during which its fingers may close and open."""

    driver: ClassVar[str] = "robotiq"
    package: ClassVar[str] = "pymodbus"
    extra: ClassVar[str] = "ur"
    options_type: ClassVar[type] = RobotiqOptions
    serves: ClassVar[Mapping[str, tuple[int, int]]] = {"gripper": (1, 1)}
    unsupported: Mapping[str, str] = {
        "gripper force below least_force": "the gripper presses with its least force",
    }

    def make_parts(self) -> dict[str, Part]:
        """The gripper of ``settings.parts``."""
        (name,) = self.settings.parts
        gripper = self.model.of(GripperModel)[name]
        self._channel = RobotiqChannel(self.name, gripper, self.options, self.clock)
        self._gripper = CommandedGripper(name, gripper, self._channel, self.latch)
        return {name: self._gripper}

    def open(self) -> None:
        """Connect and activate."""
        self._channel.open(self._make_wire())
        self.add_loop("gripper", self.options.rate, self._cycle)

    def close(self) -> None:
        """Close the wire; what is held stays held."""
        self._channel.close()

    def heard(self) -> float:
        """When the gripper last answered."""
        return self._channel.heard

    def reported_fault(self) -> Failure | None:
        """Its fault number, or a link that is too slow."""
        return self._channel.fault or self._channel.slowness

    def recover(self) -> None:
        """Activate anew, which clears faults."""
        self._channel.activate()

    def _cycle(self, elapsed: float) -> None:
        self._channel.refresh()
        if self._channel.fault is None:
            self._gripper.cycle(elapsed)

    def _make_wire(self) -> RobotiqWire:
        options: RobotiqOptions = self.options
        address, port = self.settings.address, self.settings.port
        if options.protocol == "urcap":
            return URCapWire(address, port or URCAP_PORT, options.timeout)
        registers = (options.device, options.command_register, options.status_register)
        return ModbusWire(self.sdk, address, port or MODBUS_PORT, options.timeout, *registers)
