"""Robotiq 2F grippers over their URCap's socket or Modbus TCP."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hal.api import NoDataError, Part
from hal.hardware import Connection, ConnectionFailedError, Fault, GripperChannel, GripperReading, HardwareGripper
from hal.robotiq.faults import fault_of
from hal.robotiq.options import RobotiqOptions
from hal.robotiq.wire import MODBUS_PORT, URCAP_PORT, ModbusWire, RobotiqStatus, RobotiqWire, URCapWire, refused

ACTIVE = 3
ACTIVATION_TIME = 10.0
CLOSED_ON_OBJECT = frozenset({1, 2})


class RobotiqConnection(Connection, GripperChannel):
    """One gripper. It is activated when connected, during which its fingers may close and open."""

    driver: ClassVar[str] = "robotiq"
    extra: ClassVar[str] = "ur"
    options_type: ClassVar[type] = RobotiqOptions
    declared_missing: Mapping[str, str] = {
        "gripper force below least_force": "the gripper presses with its least force",
    }

    def make_parts(self) -> dict[str, Part]:
        """The gripper of ``settings.parts``."""
        name = next(name for name in self.settings.parts if name in self.model.grippers)
        self._ranges = self.model.grippers[name]
        self._gripper = HardwareGripper(name, self._ranges, self, self.latch)
        self._wire: RobotiqWire | None = None
        self._speaking = threading.Lock()
        self._status: RobotiqStatus | None = None
        self._asked: int | None = None
        self._heard = 0.0
        return {name: self._gripper}

    def open(self) -> None:
        """Connect and activate."""
        self._wire = self._make_wire()
        try:
            self._wire.open()
        except OSError as error:
            raise refused(self.name, error) from None
        self._make_active()
        self.add_loop("gripper", self.options.rate, self._cycle)

    def close(self) -> None:
        """Close the wire; what is held stays held."""
        if self._wire is not None:
            self._wire.close()

    def heard(self) -> float:
        """When the gripper last answered."""
        return self._heard

    def reported_fault(self) -> Fault | None:
        """Its fault number."""
        status = self._status
        return fault_of(status.fault) if status is not None else None

    def recover(self) -> None:
        """Activate anew, which clears faults."""
        self._make_active()

    # The channel of the part

    def read(self) -> GripperReading:
        """The width, and whether the fingers were stopped by an object on the way that they were last sent."""
        status = self._status
        if status is None:
            raise NoDataError("the Robotiq gripper has told nothing yet")
        options, ranges = self.options, self._ranges
        share = (status.position - options.open_position) / (options.closed_position - options.open_position)
        width = ranges.max_width - share * (ranges.max_width - ranges.min_width)
        held = status.object in CLOSED_ON_OBJECT and status.echo == self._asked
        return GripperReading(float(np.clip(width, ranges.min_width, ranges.max_width)), held)

    def send(self, width: float, force: float, speed: float) -> None:
        """Go to a width."""
        options, ranges = self.options, self._ranges
        share = (ranges.max_width - width) / (ranges.max_width - ranges.min_width)
        position = round(options.open_position + share * (options.closed_position - options.open_position))
        self._asked = position
        self._speak(
            lambda wire: wire.go(
                position,
                _byte(speed, options.least_speed, ranges.max_speed),
                _byte(force, options.least_force, ranges.max_force),
            )
        )

    def halt(self) -> None:
        """Stay where the fingers are."""
        self._speak(lambda wire: wire.halt())

    # Private

    def _cycle(self, elapsed: float) -> None:
        self._refresh()
        if self.reported_fault() is None:
            self._gripper.cycle(elapsed)

    def _refresh(self) -> None:
        status = self._speak(lambda wire: wire.status())
        if status is not None:
            self._status = status

    def _speak(self, exchange) -> RobotiqStatus | None:  # noqa: ANN001 - annotated below
        """One exchange; what is not answered is left to the watchdog, and ends the wire, whose replies are out of step."""
        with self._speaking:
            wire = self._wire
            if wire is None:
                return None
            try:
                answer = exchange(wire)
            except OSError:
                wire.close()
                return None
            self._heard = self.clock.now()
            return answer

    def _make_active(self) -> None:
        self._asked = None
        deadline = time.monotonic() + ACTIVATION_TIME
        self._refresh()
        if self._status is None:
            raise ConnectionFailedError(f"{self.name}: the Robotiq gripper does not answer")
        if self._status.activation != ACTIVE or self.reported_fault() is not None:
            self._speak(lambda wire: wire.reset())
            self._speak(lambda wire: wire.activate())
        while self._status.activation != ACTIVE or self.reported_fault() is not None:
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self.name}: the Robotiq gripper does not become active")
            time.sleep(0.05)
            self._refresh()

    def _make_wire(self) -> RobotiqWire:
        options: RobotiqOptions = self.options
        address, port = self.settings.address, self.settings.port
        if options.protocol == "urcap":
            return URCapWire(address, port or URCAP_PORT, options.timeout)
        return ModbusWire(
            self.sdk,
            address,
            port or MODBUS_PORT,
            options.timeout,
            options.device,
            options.command_register,
            options.status_register,
        )


def _byte(value: float, least: float, most: float) -> int:
    """A value within [least, most] as 0 to 255."""
    return round(255.0 * float(np.clip((value - least) / max(most - least, 1e-9), 0.0, 1.0)))
