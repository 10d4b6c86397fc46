"""Tool poses streamed to an arm: each a small step of inverse kinematics from the one before."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics import InverseKinematics
from bestman_bt.messages import Pose
from hal.api import Arm


@dataclass(frozen=True)
class Streaming:
    """How poses are streamed. ``period``: seconds between two set-points. ``speed_share``: of the joints' speed limits.

    ``min_manipulability``: Yoshikawa's measure below which the arm goes no further towards a singularity.
    ``posture_rate``: 1/s, how fast redundancy brings the arm to a posture that is asked for.
    """

    period: float = 1.0 / 60.0
    speed_share: float = 0.6
    min_manipulability: float = 0.01
    posture_rate: float = 3.0


class StreamStep(Enum):
    """What became of a pose that was asked for; only the first one moves the arm."""

    SENT = "sent"
    TOO_FAST = "too fast"
    UNREACHABLE = "unreachable"


class ToolStream:
    """Begins where the arm is. ``pose``: base_from_tool that was sent last."""

    def __init__(self, arm: Arm, kinematics: InverseKinematics, streaming: Streaming = Streaming()) -> None:
        self._arm, self._kinematics = arm, kinematics
        self.streaming = streaming
        self._positions: NDArray[np.float64] = arm.positions()
        self.pose = kinematics.tool_pose(self._positions)
        self._manipulability = kinematics.manipulability(self._positions)
        speed = arm.model.velocity
        self._largest_step = self.streaming.speed_share * self.streaming.period * speed

    def measured(self) -> Pose:
        """Where the tool is, by encoders."""
        return self._kinematics.tool_pose(self._arm.positions())

    def send(self, base_from_tool: Pose, posture: NDArray[np.float64] | None = None) -> StreamStep:
        """Ask for the next pose; CommandRefusedError if the arm takes no commands.

        ``posture``: (n,), which the arm comes nearer to without moving the tool for it (Liégeois, 1977).
        """
        start = self._positions if posture is None else self._positions + self._towards(posture)
        positions = self._kinematics.track(base_from_tool, start)
        if positions is None:
            return StreamStep.UNREACHABLE
        if np.any(np.abs(positions - self._positions) > self._largest_step):
            return StreamStep.TOO_FAST
        manipulability = self._kinematics.manipulability(positions)
        if manipulability < min(self.streaming.min_manipulability, self._manipulability):
            return StreamStep.UNREACHABLE
        self._arm.servo(positions)
        self._positions, self.pose, self._manipulability = positions, base_from_tool, manipulability
        return StreamStep.SENT

    def _towards(self, posture: NDArray[np.float64]) -> NDArray[np.float64]:
        """A step (n,) in the null space of the tool's motion, of at most a third of what the joints may do."""
        wanted = self.streaming.posture_rate * self.streaming.period * (posture - self._positions)
        wanted = wanted * min(1.0, 1.0 / max(float(np.abs(3.0 * wanted / self._largest_step).max()), 1e-9))
        jacobian = self._kinematics.jacobian(self._positions)
        step: NDArray[np.float64] = wanted - np.linalg.pinv(jacobian, rcond=1e-3) @ (jacobian @ wanted)
        return step
