"""What grippers refuse: widths, forces and speeds beyond their ranges."""

from __future__ import annotations

import math

from bestman_bt.robot_model import GripperModel
from hal.api import CommandRefusedError


class GripperCommandChecks:
    """The ranges of a gripper, and the checks of its commands; faults raise CommandRefusedError.

    ``usual_force`` (N) and ``usual_speed`` (m/s, rate of the width): of commands that do not say; the gripper's most by
    default, and never more than that. ``least_width``: metres; the model's by default.
    """

    def __init__(
        self,
        part_name: str,
        model: GripperModel,
        usual_force: float = math.inf,
        usual_speed: float = math.inf,
        least_width: float | None = None,
    ) -> None:
        self._part_name, self._model = part_name, model
        self._usual_force = min(usual_force, model.part.max_force)
        self._usual_speed = min(usual_speed, model.part.max_speed)
        self._least_width = model.part.min_width if least_width is None else least_width

    def move(self, width: float, force: float | None, speed: float | None) -> tuple[float, float, float]:
        """Width, force and speed of a command within the ranges."""
        part = self._model.part
        force = self._usual_force if force is None else force
        speed = self._usual_speed if speed is None else speed
        for what, value, lower, upper, unit in (
            ("width", width, self._least_width - 1e-9, self._model.max_width + 1e-9, "m"),
            ("force", force, 1e-9, part.max_force, "N"),
            ("speed", speed, 1e-9, part.max_speed, "m/s"),
        ):
            if not (math.isfinite(value) and lower <= value <= upper):
                why = f"{what} = {value} {unit} is not within [{max(lower, 0.0):.4g}, {upper:.4g}] {unit}"
                raise CommandRefusedError(f"{self._part_name} refused move: {why}", self._part_name)
        return float(width), float(force), float(speed)
