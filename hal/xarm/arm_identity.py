"""Which arm a controller moves, and whether that is the one of the robot file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from bestman_bt.robot_model import ArmModel
from hal.xarm.options import ArmKind

LITE6 = 9
"""The Lite 6's type in the controller's version."""
NARROWER_SINCE, UNTIL = 1305, 8500
"""Serial numbers of xArms whose limits the SDK lists under a type of their own."""
ROUNDING = 0.01


@dataclass(frozen=True)
class ArmIdentity:
    """What a controller tells: number of joints, type, and, by the SDK's table, their limits (radians), or none."""

    axes: int
    device_type: int
    limits: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, arm: Any, load: Callable[[str], ModuleType]) -> ArmIdentity:
        """The identity of the SDK's connected ``arm``; its limits are looked up as the SDK does."""
        serial = arm.sn[2:6] if arm.sn else ""
        narrower = serial.isdigit() and NARROWER_SINCE <= int(serial) < UNTIL
        listed_as = int(f"{arm.axis}{NARROWER_SINCE}") if narrower else arm.device_type
        table: Mapping[int, Mapping[int, Any]] = load("xarm.core.config.x_config").XCONF.Robot.JOINT_LIMITS
        limits = tuple((low, high) for low, high in table.get(arm.axis, {}).get(listed_as, ()))
        return cls(int(arm.axis), int(arm.device_type), limits)

    def mismatch(self, kind: ArmKind, model: ArmModel) -> str | None:
        """What speaks against its being the arm of the robot file, else None."""
        if self.axes != len(model.joint_names):
            return f"the controller has {self.axes} joints, the robot file's arm has {len(model.joint_names)}"
        told: ArmKind = "lite6" if self.device_type == LITE6 else "xarm"
        if told != kind:
            return f"the controller moves an arm of the kind {told!r}, the option 'arm' says {kind!r}"
        if not self.limits:  # a type that the SDK's table lacks
            return None
        for joint, (low, high), lower, upper in zip(
            model.joint_names, self.limits, model.lower, model.upper, strict=True
        ):
            if lower < low - ROUNDING or upper > high + ROUNDING:
                ranges = " to ".join(f"{math.degrees(end):.1f}°" for end in (low, high))
                asked = " to ".join(f"{math.degrees(end):.1f}°" for end in (lower, upper))
                return f"the controller's {joint} goes from {ranges}, the robot file's from {asked}: 'set' its limits"
        return None
