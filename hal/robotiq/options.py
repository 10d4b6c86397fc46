"""What a robot's YAML may say about a Robotiq gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from bestman_bt.configuration.quantity import Force, Frequency, PositiveTime, Speed

Byte = Annotated[int, Field(ge=0, le=255)]
Register = Annotated[int, Field(ge=0, le=65535)]


@dataclass(frozen=True)
class RobotiqOptions:
    """Options of ``driver: robotiq``.

    ``protocol``: ``urcap``, the socket of its URCap at the UR's address, or ``modbus``, Modbus TCP.
    ``open_position``, ``closed_position``: the gripper's own numbers where the fingers are fully open and closed.
    ``least_force``, ``least_speed``: what its numbers 0 mean; 255 are the part's ``max_force`` and ``max_speed``.
    ``device``, ``command_register``, ``status_register``: of Modbus; a gateway to the serial gripper has 9, 1000, 2000.
    ``rate``: hertz of its readings. ``timeout``: seconds that it may take to answer once; ``longest_delay``: for long.
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
