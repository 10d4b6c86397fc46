"""What mobile bases refuse: velocities beyond their limits, distances and angles that mean nothing."""

from __future__ import annotations

import math

from bestman_bt.messages import Twist2D
from bestman_bt.robot_model import BaseModel
from hal.api import CommandRefusedError


class BaseCommandChecks:
    """The checks of a base's commands; faults raise CommandRefusedError."""

    def __init__(self, part_name: str, model: BaseModel) -> None:
        self._part_name, self._limits = part_name, model.part

    def velocity(self, vx: float, vy: float, wz: float) -> Twist2D:
        """A velocity within the limits."""
        limits = self._limits
        for what, value, limit, unit in (
            ("vx", vx, limits.max_vx, "m/s"),
            ("vy", vy, limits.max_vy, "m/s"),
            ("wz", wz, limits.max_wz, "rad/s"),
        ):
            if not (math.isfinite(value) and abs(value) <= limit + 1e-9):
                raise self._refuse("set_velocity", f"{what} = {value} {unit}, its limit is {limit} {unit}")
        return Twist2D(float(vx), float(vy), float(wz))

    def distance(self, command: str, distance: float) -> float:
        """Metres, above 0."""
        if not (math.isfinite(distance) and distance > 0.0):
            raise self._refuse(command, f"distance = {distance} m should be finite and above 0")
        return float(distance)

    def angle(self, command: str, angle: float) -> float:
        """Radians."""
        if not math.isfinite(angle):
            raise self._refuse(command, f"angle = {angle} rad should be finite")
        return float(angle)

    def _refuse(self, command: str, why: str) -> CommandRefusedError:
        return CommandRefusedError(f"{self._part_name} refused {command}: {why}", self._part_name)
