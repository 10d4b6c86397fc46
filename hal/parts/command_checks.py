"""What joints refuse: commands that are malformed, not finite or beyond a limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model import JointedModel
from hal.api import CommandRefusedError

Array = NDArray[np.float64]
START_TOLERANCE = 0.05
"""How far from the arm's place a trajectory may start, radians."""
SPEED_TOLERANCE = 1.02
"""Share of the speed limits up to which samples and streamed set-points are taken."""


class JointCommandChecks:
    """The checks of the commands of a group of joints; faults raise CommandRefusedError."""

    def __init__(self, part_name: str, model: JointedModel) -> None:
        self._part_name, self._model = part_name, model

    def refuse(self, command: str, why: str) -> CommandRefusedError:
        """The error for a command that is malformed or beyond a limit."""
        return CommandRefusedError(f"{self._part_name} refused {command}: {why}", self._part_name)

    def positions(self, command: str, values: ArrayLike) -> Array:
        """Positions within the limits."""
        return self._within(command, "positions", values, self._model.lower, self._model.upper)

    def velocities(self, command: str, values: ArrayLike) -> Array:
        """Velocities within the limits."""
        return self._within(command, "velocities", values, -self._model.velocity, self._model.velocity)

    def efforts(self, command: str, values: ArrayLike) -> Array:
        """Efforts within the limits."""
        return self._within(command, "efforts", values, -self._model.effort, self._model.effort)

    def one_kind(self, command: str, *kinds: ArrayLike | None) -> None:
        """Exactly one of the kinds of set-point is given."""
        given = sum(kind is not None for kind in kinds)
        if given != 1:
            raise self.refuse(command, f"exactly one of positions, velocities, efforts is to be given, not {given}")

    def speed_scale(self, command: str, scale: float) -> float:
        """A share of the limits, within (0, 1]."""
        if not (np.isfinite(scale) and 0.0 < scale <= 1.0):
            raise self.refuse(command, f"speed_scale = {scale} is not within (0, 1]")
        return float(scale)

    def servo(self, target: Array, position: Array, interval: float) -> None:
        """``target`` can be reached from ``position`` within ``interval`` seconds."""
        speed = np.abs(target - position) / interval
        worst = int(np.argmax(speed / self._model.velocity))
        if speed[worst] > self._model.velocity[worst] * SPEED_TOLERANCE:
            raise self.refuse(
                "servo",
                f"{self._model.joint_names[worst]} would need {speed[worst]:.3f} rad/s, its limit is "
                f"{self._model.velocity[worst]:.3f} rad/s",
            )

    def trajectory(self, trajectory: JointTrajectory, measured: Array) -> None:
        """Its joints are these, all samples are within the limits, and it starts at ``measured``."""
        names, limit = self._model.joint_names, self._model.velocity * SPEED_TOLERANCE
        if trajectory.joint_names != names:
            raise self.refuse("follow", f"the joints are {trajectory.joint_names}, but this arm's are {names}")
        pairs = [(trajectory.positions, self._model.lower, self._model.upper, "position")]
        speeds = [trajectory.velocities]
        if len(trajectory.times) > 1:
            speeds.append(np.diff(trajectory.positions, axis=0) / np.diff(trajectory.times)[:, None])
        pairs += [(speed, -limit, limit, "velocity") for speed in speeds]
        for values, lower, upper, what in pairs:
            wrong = ~((values >= lower - 1e-6) & (values <= upper + 1e-6))
            if np.any(wrong):
                sample, joint = (int(index) for index in np.argwhere(wrong)[0])
                raise self.refuse(
                    "follow",
                    f"{what} of {names[joint]} in sample {sample} is {values[sample, joint]:.4f}, its "
                    f"limits are [{lower[joint]:.4f}, {upper[joint]:.4f}]",
                )
        start = trajectory.positions[0]
        worst = int(np.argmax(np.abs(start - measured)))
        if abs(start[worst] - measured[worst]) > START_TOLERANCE:
            raise self.refuse(
                "follow",
                f"the trajectory starts with {names[worst]} = {start[worst]:.4f}, but it is at "
                f"{measured[worst]:.4f}; within {START_TOLERANCE} would be accepted",
            )

    def _within(self, command: str, what: str, values: ArrayLike, lower: Array, upper: Array) -> Array:
        try:
            array = np.array(values, dtype=float)
        except (TypeError, ValueError) as error:
            raise self.refuse(command, f"{what} are not numbers: {values!r}") from error
        if array.shape != lower.shape:
            raise self.refuse(command, f"{what} should have shape {lower.shape} but have {array.shape}")
        if not np.all(np.isfinite(array)):
            raise self.refuse(command, f"{what} should be finite but are {array.tolist()}")
        for joint, value, low, high in zip(self._model.joint_names, array, lower, upper, strict=True):
            if not low - 1e-6 <= value <= high + 1e-6:
                why = f"{what} of {joint} = {value:.4f} is beyond its limits [{low:.4f}, {high:.4f}]"
                raise self.refuse(command, why)
        clipped: Array = np.clip(array, lower, upper)
        return clipped
