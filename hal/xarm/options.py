"""What a robot's YAML may say about an xArm controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from bestman_bt.configuration.quantity import Frequency, Lengths3, Mass, PositiveTime

ArmKind = Literal["xarm", "lite6"]
"""An xArm 6 or 7, by its number of joints, or a Lite 6."""
Rate = Annotated[Frequency, Field(le=250.0)]
"""The controller takes a set-point every 4 ms at most."""
Sensitivity = Annotated[int, Field(ge=0, le=5)]
Pulses = Annotated[int, Field(gt=0)]


@dataclass(frozen=True)
class XArmOptions:
    """Options of ``driver: xarm``.

    ``arm``: which arm the controller has to say that it moves; a Lite 6 has its own gripper. ``rate``: hertz of the
    set-points. ``collision_sensitivity``: the controller's, 0 (off) to 5; None leaves its own.
    ``reduced_mode``: hold the controller, too, to the speeds of the robot model and of ``safety``.
    ``payload``, ``payload_center``: kg and metres in the flange, of what the arm carries always, for the collision
    detection. ``gripper_pulses``: the gripper's own position when fully open. ``gripper_rate``: hertz of its readings.
    ``reply_timeout``, ``connect_timeout``: seconds that a command and the first one wait for the reply.
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
