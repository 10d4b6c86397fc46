"""Robotiq 2F grippers over their URCap's socket or Modbus TCP."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import Field

from bestman_bt.configuration.quantity import Force, Frequency, PositiveTime, Speed
from bestman_bt.robot_model.model import GripperModel
from hal.api import Clock, Failure, MotionErrorCode, NoDataError
from hal.hardware.clock import LatencyMonitor
from hal.hardware.connection import Connection, PartFactory
from hal.parts.channels import GripperChannel, GripperReading
from hal.parts.gripper import CommandedGripper
from hal.parts.part_connection import ConnectionFailedError
from hal.robotiq.wire import MODBUS_PORT, URCAP_PORT, ModbusWire, RobotiqStatus, RobotiqWire, URCapWire

Byte = Annotated[int, Field(ge=0, le=255)]
Register = Annotated[int, Field(ge=0, le=65535)]


@dataclass(frozen=True)
class RobotiqOptions:
    """Options of ``driver: robotiq``.

    ``protocol``: ``urcap``, the socket of its URCap at the UR's address, or ``modbus``, Modbus TCP. ``open_position``,
    ``closed_position``: register values with the fingers fully open and closed. ``least_force``, ``least_speed``:
    newtons and m/s at a register value of 0; 255 is the part's ``max_force`` and ``max_speed``. ``device``,
    ``command_register``, ``status_register``: Modbus numbers; a gateway to the serial gripper has 9, 1000, 2000.
    ``rate``: rate of the readings, Hz. ``timeout``: seconds for a single reply; ``longest_delay``: largest sustained
    delay of replies, seconds. ``activate_holding``: whether to activate a hand that may hold an object, which drops it.
    """

    protocol: Literal["urcap", "modbus"] = "urcap"
    open_position: Byte = 3
    closed_position: Byte = 230
    least_force: Force = 20.0
    least_speed: Speed = 0.02
    device: Byte = 2
    command_register: Register = 0
    status_register: Register = 0
    rate: Frequency = 50.0
    timeout: PositiveTime = 0.5
    longest_delay: PositiveTime = 0.1
    activate_holding: bool = False


WORDS = {
    5: "an action waits for the activation",
    7: "it is not activated",
    8: "it is too hot",
    9: "it had no communication for a second",
    10: "its supply voltage is too low",
    11: "it releases automatically",
    12: "internal fault",
    13: "its activation failed",
    14: "overcurrent",
    15: "it has released automatically",
}
HARMLESS = frozenset({0, 5, 9})
"""Fault numbers that need no action: no fault; a command during activation; and a pause in our requests, which ends
with the next round trip.
"""


def fault_of(status: RobotiqStatus) -> Failure | None:
    """Return the fault in ``gFLT`` and ``gSTA``, None if the gripper is active without a fault."""
    if status.fault not in HARMLESS:
        words, number = WORDS.get(status.fault, "unknown fault"), f"gFLT {status.fault}"
    elif status.activation != ACTIVE:
        words, number = "it is not activated: it had no power or was reset", f"gSTA {status.activation}"
    else:
        return None
    return Failure(MotionErrorCode.FAULT, f"gripper: {words}", vendor_code=number)


Answer = TypeVar("Answer")
RESET, ACTIVE = 0, 3
STOPPED_BY_OBJECT = frozenset({1, 2})
ACTIVATION_TIME = 10.0
RESET_TIME = 0.5
"""Seconds between the reset and the activation, as ``rq_reset`` of Robotiq's URCap waits."""
LEAST_MOVE = 2
"""Minimum change of the position register that counts as a motion."""


class RobotiqChannel(GripperChannel):
    """Communicates over an open connection; a missing reply closes it, because later replies would be out of step."""

    def __init__(self, name: str, model: GripperModel, options: RobotiqOptions, clock: Clock) -> None:
        self._name, self._model, self._options, self._clock = name, model, options, clock
        self._speaking = threading.Lock()
        self._wire: RobotiqWire | None = None
        self._status: RobotiqStatus | None = None
        self._asked: int | None = None
        self._from, self._moved = 0, False
        self._may_hold = False  # when it was last active and well
        self._lateness = LatencyMonitor()
        self.heard = 0.0

    def open(self, wire: RobotiqWire) -> None:
        """Connect and activate. Raises ConnectionFailedError; the message does not contain the address."""
        self._wire, self._status = wire, None  # what it may hold it holds still
        self._lateness.forget()
        try:
            wire.open()
        except OSError as error:
            why = type(error).__name__
            raise ConnectionFailedError(f"{self._name}: the Robotiq gripper cannot be reached ({why})") from None
        self.activate()

    def close(self) -> None:
        """Close the connection; a held object stays held. Idempotent."""
        wire, self._wire = self._wire, None
        if wire is not None:
            wire.close()

    def activate(self) -> None:
        """Activate the gripper unless it is active without a fault. Raises ConnectionFailedError, also if this would
        drop an object.

        During an activation the fingers open and close. They are self-locking without power.
        """
        self._asked = None
        deadline = time.monotonic() + ACTIVATION_TIME
        if fault_of(self._last_status()) is not None:
            if self._may_hold and not self._options.activate_holding:
                raise ConnectionFailedError(
                    f"{self._name}: the Robotiq gripper has to be activated again, and would drop what it may hold: "
                    "take that out of the hand, then allow it by options.activate_holding: true"
                )
            self._await(lambda: self._last_status().activation == RESET, deadline, lambda wire: wire.reset())
            time.sleep(RESET_TIME)  # an activation that still comes too early is not taken, so it is repeated
            self._await(lambda: self._last_status().activation != RESET, deadline, lambda wire: wire.activate())
        self._await(lambda: fault_of(self._last_status()) is None, deadline)

    def refresh(self) -> bool:
        """Read the status in one round trip; without a reply the last one stays valid."""
        status = self._exchange(lambda wire: wire.status())
        if status is None:
            return False
        self._moved = self._moved or abs(status.position - self._from) >= LEAST_MOVE
        self._status = status
        if fault_of(status) is None and status.goes:  # a halt lets go of nothing
            self._may_hold = status.object in STOPPED_BY_OBJECT
        return True

    @property
    def fault(self) -> Failure | None:
        """Return the fault that the gripper reports."""
        return fault_of(self._status) if self._status is not None else None

    @property
    def slowness(self) -> Failure | None:
        """Return the fault if its recent answers were too slow, else None."""
        late = self._lateness.late(self._options.longest_delay, self._clock.now())
        return Failure(MotionErrorCode.TIMEOUT, f"answers take {late:.2f} s") if late is not None else None

    def read(self) -> GripperReading:
        """Return the width, metres, and whether an object stopped the fingers before their last target.

        Raises NoDataError before the first report.
        """
        status = self._status
        if status is None:
            raise NoDataError(f"{self._name}: the Robotiq gripper has not reported anything yet", self._name)
        options, model = self._options, self._model
        share = (status.position - options.open_position) / (options.closed_position - options.open_position)
        width = model.max_width - share * (model.max_width - model.part.min_width)
        felt = status.object in STOPPED_BY_OBJECT and status.goes and status.echo == self._asked
        held = felt and self._moved and self.fault is None
        return GripperReading(float(np.clip(width, model.part.min_width, model.max_width)), held)

    def send(self, width: float, force: float, speed: float) -> None:
        """Send a target width."""
        options, model = self._options, self._model
        share = (model.max_width - width) / (model.max_width - model.part.min_width)
        position = round(options.open_position + share * (options.closed_position - options.open_position))
        speed_byte = _byte(speed, options.least_speed, model.part.max_speed)
        force_byte = _byte(force, options.least_force, model.part.max_force)
        status = self._status
        if status is not None:
            presses_on = self.read().object_held and position > status.position
            self._from, self._moved = status.position, bool(presses_on)
        self._asked = position
        self._exchange(lambda wire: wire.go(position, speed_byte, force_byte))

    def halt(self) -> None:
        """Stop the fingers at their current position."""
        self._exchange(lambda wire: wire.halt())

    def _last_status(self) -> RobotiqStatus:
        self.refresh()
        if self._status is None:
            raise ConnectionFailedError(f"{self._name}: the Robotiq gripper does not answer")
        return self._status

    def _await(
        self, come: Callable[[], bool], deadline: float, ask: Callable[[RobotiqWire], None] = lambda wire: None
    ) -> None:
        """Repeat ``ask`` until it has ``come``."""
        self._exchange(ask)
        while not come():
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self._name}: the Robotiq gripper does not become active")
            time.sleep(0.05)
            self._exchange(ask)

    def _exchange(self, exchange: Callable[[RobotiqWire], Answer]) -> Answer | None:
        with self._speaking:
            wire = self._wire
            if wire is None:
                return None
            asked = self._clock.now()
            try:
                answer = exchange(wire)
            except OSError:
                wire.close()
                return None
            self.heard = self._clock.now()
            self._lateness.lag = self.heard - asked
            return answer


def _byte(value: float, least: float, most: float) -> int:
    """Return a value within [least, most] as 0 to 255."""
    return round(255.0 * float(np.clip((value - least) / max(most - least, 1e-9), 0.0, 1.0)))


class RobotiqConnection(Connection):
    """A Robotiq gripper. Connecting activates it; its fingers may close and open meanwhile."""

    driver: ClassVar[str] = "robotiq"
    package: ClassVar[str] = "pymodbus"
    extra: ClassVar[str] = "ur"
    options_type: ClassVar[type] = RobotiqOptions
    serves: ClassVar[Mapping[str, tuple[int, int]]] = {"gripper": (1, 1)}
    unsupported: Mapping[str, str] = {
        "gripper force below least_force": "the gripper presses with its least force",
    }

    def factories(self) -> Mapping[str, PartFactory]:
        """Return the factory of the gripper."""
        return {"gripper": self._make_gripper}

    def _make_gripper(self, name: str, model: GripperModel) -> CommandedGripper:
        self._channel = RobotiqChannel(self.name, model, self.options, self.clock)
        self._gripper = CommandedGripper(name, model, self._channel, self.latch)
        return self._gripper

    def open(self) -> None:
        """Connect and activate."""
        self._channel.open(self._make_wire())
        self.add_loop("gripper", self.options.rate, self._cycle)

    def close(self) -> None:
        """Close the connection; a held object stays held."""
        self._channel.close()

    def heard(self) -> float:
        """Return the time of the gripper's last reply."""
        return self._channel.heard

    def reported_fault(self) -> Failure | None:
        """Return the failure that corresponds to the gripper's fault number, or to a connection that is too slow."""
        return self._channel.fault or self._channel.slowness

    def recover(self) -> None:
        """Activate again, which clears faults."""
        self._channel.activate()

    def _cycle(self, elapsed: float) -> None:
        if self._channel.fault is None:
            self._gripper.cycle(elapsed)
        else:
            self._channel.refresh()

    def _make_wire(self) -> RobotiqWire:
        options: RobotiqOptions = self.options
        address, port = self.settings.address, self.settings.port
        if options.protocol == "urcap":
            return URCapWire(address, port or URCAP_PORT, options.timeout)
        registers = (options.device, options.command_register, options.status_register)
        return ModbusWire(self.sdk, address, port or MODBUS_PORT, options.timeout, *registers)
