"""What mobile bases refuse: velocities beyond their limits, distances and angles that mean nothing."""

from __future__ import annotations

import math

from bestman_bt.messages import Twist2D
from bestman_bt.robot_model import BaseModel
from hal.api import BaseDescription, CommandRefusedError


class BaseCommandChecks:
    """The limits of a base, and the checks of its commands; faults raise CommandRefusedError."""

    def __init__(self, part_name: str, model: BaseModel) -> None:
        self._part_name, self._model = part_name, model

    def description(self, command_timeout: float) -> BaseDescription:
        """Limits and footprint; ``command_timeout``: seconds after which velocities lapse."""
        model = self._model
        return BaseDescription(
            max_vx=model.max_vx,
            max_vy=model.max_vy,
            max_wz=model.max_wz,
            max_acceleration=model.max_acceleration,
            max_angular_acceleration=model.max_angular_acceleration,
            command_timeout=command_timeout,
            footprint=model.footprint,
            max_jerk=model.max_jerk,
            max_angular_jerk=model.max_angular_jerk,
            turning_drift=model.turning_drift,
        )

    def velocity(self, vx: float, vy: float, wz: float) -> Twist2D:
        """A velocity within the limits."""
        model = self._model
        for what, value, limit, unit in (
            ("vx", vx, model.max_vx, "m/s"),
            ("vy", vy, model.max_vy, "m/s"),
            ("wz", wz, model.max_wz, "rad/s"),
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
        return CommandRefusedError(f"{self._part_name} refused {command}: {why}")
