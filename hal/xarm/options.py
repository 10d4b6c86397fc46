"""Options of an xArm controller in a robot's YAML."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from bestman_bt.configuration.quantity import Frequency, Lengths3, Mass, PositiveTime

ArmKind = Literal["xarm", "lite6"]
"""An xArm 6 or 7, by its number of joints, or a Lite 6."""
Rate = Annotated[Frequency, Field(le=250.0)]
"""The controller accepts at most one set-point every 4 ms."""
Sensitivity = Annotated[int, Field(ge=0, le=5)]
Pulses = Annotated[int, Field(gt=0)]


@dataclass(frozen=True)
class XArmOptions:
    """Options of ``driver: xarm``.

    ``arm``: the arm type that the controller must report; a Lite 6 has its own gripper. ``rate``: rate of the
    set-points, Hz. ``collision_sensitivity``: of the controller, 0 (off) to 5; None keeps its own. ``reduced_mode``:
    whether the controller also enforces the speeds of the robot model and of ``safety``. ``payload``,
    ``payload_center``: mass, kg, and centre of mass, metres in the flange frame, of the permanent load, for the
    collision detection. ``gripper_pulses``: the gripper's position value when fully open. ``gripper_rate``: rate of its
    readings, Hz. ``reply_timeout``, ``connect_timeout``: seconds to wait for the reply to a command, and to the first
    one.
    """

    arm: ArmKind = "xarm"
    rate: Rate = 200.0
    collision_sensitivity: Sensitivity | None = None
    reduced_mode: bool = False
    payload: Mass | None = None
    payload_center: Lengths3 = (0.0, 0.0, 0.0)
    gripper_pulses: Pulses = 850
    gripper_rate: Frequency = 10.0
    reply_timeout: PositiveTime = 0.2
    connect_timeout: PositiveTime = 2.0
