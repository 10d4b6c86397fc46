"""The twin of a Robotiq 2F gripper: its URCap's socket on port 63352, or Modbus TCP on port 502."""

from __future__ import annotations

import socket
import struct

import numpy as np

from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from hal.api import Gripper, Motion, MotionStatus
from hal.twins.tcp_server import TcpTwin, lines, modbus_frames
from hal.twins.world import TwinWorld

OPEN, CLOSED = 3, 230
"""Its position values with the fingers fully open and closed."""
LEAST_SPEED, LEAST_FORCE = 0.02, 20.0
ACTIVATION_TIME, RESET_TIME = 0.3, 0.4
RESET, ACTIVATING, ACTIVE = 0, 1, 3
MOVING, HELD, ARRIVED = 0, 2, 3
NOT_ACTIVATED_FAULT, OVERCURRENT_FAULT = 7, 14


class RobotiqGripper:
    """The simulated gripper. Protocol servers call it from their threads; it uses the robot only in ``tick``, in the
    world's thread.

    ``variables``: its state, by the names of its URCap. ``arm``: the arm whose flange powers it; "": always powered.
    Sources: Robotiq's instruction manual of the 2F-85 (gACT, gGTO, gSTA, gOBJ, gFLT; after a loss of power gSTA is 0,
    and its self-locking fingers keep their position), and ``rq_reset`` of its URCap, which waits for ACT and STA to be
    0 and then 500 ms: an earlier activation is ignored here.
    """

    def __init__(self, world: TwinWorld, gripper: Gripper, arm: str = "") -> None:
        self._arm, self._powered, self._reset_since = arm, True, 0.0
        self._world, self._gripper = world, gripper
        self._target, self._speed, self._force = OPEN, 255, 255
        self._wanted = {"ACT": 0, "GTO": 0}
        self._activation, self._fault, self._object = RESET, 0, ARRIVED
        self._active_in = 0.0
        self._jammed = False
        self._motion: Motion[None] | None = None
        self._position = OPEN
        self._unpowered_by_arm = False
        world.ticks.append(self.tick)

    @property
    def variables(self) -> dict[str, int]:
        """Return the current variables."""
        return {
            **self._wanted,
            "STA": self._activation,
            "OBJ": self._object,
            "FLT": self._fault,
            "PRE": self._target,
            "POS": self._position,
            "SPE": self._speed,
            "FOR": self._force,
        }

    def command(self, values: dict[str, int]) -> None:
        """Set some of ACT, GTO, POS, SPE, FOR together."""
        if not self.powered or (values.get("ACT") and self._activation == RESET and self._reset_since < RESET_TIME):
            return
        self._target = values.get("POS", self._target)
        self._speed, self._force = values.get("SPE", self._speed), values.get("FOR", self._force)
        before = dict(self._wanted)
        self._wanted |= {name: value for name, value in values.items() if name in self._wanted}
        if self._wanted["ACT"] != before["ACT"]:
            self._activate(bool(self._wanted["ACT"]))
        if self._activation != ACTIVE:
            if "POS" in values and self._wanted["GTO"] and not self._wanted["ACT"]:
                self._fault = NOT_ACTIVATED_FAULT
        elif self._wanted["GTO"] and ("POS" in values or not before["GTO"]):
            self._go()
        elif before["GTO"] and not self._wanted["GTO"]:
            self._world.post(self._gripper.stop)

    def jam(self) -> None:
        """Block the fingers until ``unjam``; the motor detects it while moving them."""
        self._jammed = True
        if self._object == MOVING:
            self._fault = OVERCURRENT_FAULT
        self._world.post(self._gripper.stop)

    @property
    def powered(self) -> bool:
        """Return whether its electronics are powered."""
        return self._powered

    def lose_power(self) -> None:
        """Cut the power, as with an unplugged cable, until ``regain_power``; the fingers keep their position."""
        self._powered = False
        self._wanted = {"ACT": 0, "GTO": 0}
        self._activation, self._fault, self._object, self._reset_since = RESET, 0, MOVING, 0.0
        self._motion = None
        self._world.post(self._gripper.stop)

    def regain_power(self) -> None:
        """Restore the power; the gripper then needs an activation."""
        self._powered = True

    def unjam(self) -> None:
        """Release the fingers; a fault stays until the next activation."""
        self._jammed = False

    def tick(self, dt: float) -> None:
        """Prepare the next physics step of the world."""
        self._reset_since += dt
        if (without := self._arm in self._world.without_power) != self._unpowered_by_arm:
            self._unpowered_by_arm = without
            (self.lose_power if without else self.regain_power)()
        closed, opened = self._gripper.model.part.min_width, self._gripper.model.max_width
        share = (opened - self._gripper.width()) / (opened - closed)
        self._position = round(OPEN + float(np.clip(share, 0.0, 1.0)) * (CLOSED - OPEN))
        if self._activation == ACTIVATING:
            self._active_in -= dt
            if self._active_in <= 0.0:
                self._activation = ACTIVE
        if self._motion is not None and self._motion.done:
            arrived = self._motion.status is MotionStatus.SUCCEEDED and self._gripper.state().at_target
            self._object = ARRIVED if arrived else HELD
            self._motion = None

    def _activate(self, on: bool) -> None:
        self._fault, self._object = 0, ARRIVED
        self._activation, self._active_in = (ACTIVATING, ACTIVATION_TIME) if on else (RESET, 0.0)
        if not on:
            self._wanted["GTO"] = 0
            self._reset_since = 0.0
            self._world.post(self._gripper.stop)

    def _go(self) -> None:
        if self._jammed:
            self._fault = OVERCURRENT_FAULT
            return
        part, opened = self._gripper.model.part, self._gripper.model.max_width
        share = float(np.clip((self._target - OPEN) / (CLOSED - OPEN), 0.0, 1.0))
        width = opened - share * (opened - part.min_width)
        speed = LEAST_SPEED + self._speed / 255.0 * (part.max_speed - LEAST_SPEED)
        force = LEAST_FORCE + self._force / 255.0 * (part.max_force - LEAST_FORCE)
        self._object = MOVING

        def begin() -> None:
            self._motion = self._gripper.move(width, force, speed)

        self._world.post(begin)


URCAP_PORT, MODBUS_PORT = 63352, 502
READ_INPUTS, WRITE_REGISTERS = 4, 16
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2


class RobotiqTwin(TcpTwin):
    """Serves one gripper on ``address`` by the connection's protocol. Raises OSError if the port is not available."""

    def __init__(self, connection: ConnectionConfig, model: RobotModel, world: TwinWorld, address: str) -> None:
        name = next(name for name in connection.parts if name in model.of(GripperModel))
        self._options = connection.options
        modbus = self._options.protocol == "modbus"
        port = connection.port or (MODBUS_PORT if modbus else URCAP_PORT)
        super().__init__(address, {port: self._attend_modbus if modbus else self._attend_urcap})
        carries = (arm for arm, of in model.of(ArmModel).items() if of.tool_frame.startswith(f"{name}_"))
        self.gripper = RobotiqGripper(world, world.robot.part(name, Gripper), next(carries, ""))
        self.faults.add(
            {
                "gripper_jam": self.gripper.jam,
                "gripper_free": self.gripper.unjam,
                "power_off": self.gripper.lose_power,
                "power_on": self.gripper.regain_power,
            }
        )

    def _attend_urcap(self, client: socket.socket) -> None:
        for line in lines(self.received(client)):
            self.send(client, self._answer_line(line.split()))

    def _answer_line(self, words: list[str]) -> bytes:
        match words:
            case ["GET", name] if name in self.gripper.variables:
                return f"{name} {self.gripper.variables[name]}\n".encode()
            case ["SET", *pairs] if len(pairs) % 2 == 0 and all(value.isdigit() for value in pairs[1::2]):
                self.gripper.command(dict(zip(pairs[::2], map(int, pairs[1::2]), strict=True)))
                return b"ack"
        return b"?\n"

    def _attend_modbus(self, client: socket.socket) -> None:
        for frame in modbus_frames(self.received(client)):
            transaction, unit, function = frame[:2], frame[6], frame[7]
            answer = self._answer_frame(function, frame[8:])
            head = transaction + struct.pack(">HHB", 0, len(answer) + 1, unit)
            if self.gripper.powered and unit == self._options.device:
                self.send(client, head + answer)

    def _answer_frame(self, function: int, data: bytes) -> bytes:
        address, count = struct.unpack_from(">HH", data)
        registers = {READ_INPUTS: self._options.status_register, WRITE_REGISTERS: self._options.command_register}
        if function not in registers:
            return bytes([function | 0x80, ILLEGAL_FUNCTION])
        if address != registers[function] or count > 3:
            return bytes([function | 0x80, ILLEGAL_ADDRESS])
        if function == READ_INPUTS:
            status = _status_registers(self.gripper.variables)[: 2 * count]
            return bytes([function, len(status)]) + status
        self.gripper.command(_commanded_variables(data[5:11]))
        return bytes([function]) + data[:4]


def _status_registers(variables: dict[str, int]) -> bytes:
    """Return the three registers of the state: activation and object in bits, fault, target, position."""
    bits = variables["ACT"] | variables["GTO"] << 3 | variables["STA"] << 4 | variables["OBJ"] << 6
    return bytes([bits, 0, variables["FLT"], variables["PRE"], variables["POS"], 0])


def _commanded_variables(registers: bytes) -> dict[str, int]:
    """Return what up to three command registers set; without GTO the position does not count."""
    bits, _, _, position, speed, force = registers.ljust(6, b"\0")
    variables = {"ACT": bits & 1, "GTO": bits >> 3 & 1, "SPE": speed, "FOR": force}
    return {**variables, "POS": position} if variables["GTO"] else variables
