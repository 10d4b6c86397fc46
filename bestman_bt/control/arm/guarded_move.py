"""Guarded moves: straight motion until contact (Will and Grossman, 1975)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.touch import WristWrench
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages import MotionErrorCode, Pose
from hal.api import Arm, Motion


@dataclass(frozen=True)
class Streaming:
    """Parameters of streamed poses. ``period``: seconds between set-points. ``speed_share``: fraction of the joint
    speed limits.

    ``min_manipulability``: Yoshikawa's measure below which the arm moves no further towards a singularity.
    ``posture_rate``: gain with which redundancy approaches a requested posture, 1/s.
    """

    period: float = 1.0 / 60.0
    speed_share: float = 0.6
    min_manipulability: float = 0.01
    posture_rate: float = 3.0


class StreamStep(Enum):
    """The result of a requested pose; only the first one moves the arm."""

    SENT = "sent"
    TOO_FAST = "too fast"
    UNREACHABLE = "unreachable"


class ToolStream:
    """A stream of tool poses that starts at the current one. ``pose``: the last pose sent, base_from_tool."""

    def __init__(self, arm: Arm, kinematics: InverseKinematics, streaming: Streaming = Streaming()) -> None:
        self._arm, self._kinematics = arm, kinematics
        self.streaming = streaming
        self._positions: NDArray[np.float64] = arm.positions()
        self.pose = kinematics.tool_pose(self._positions)
        self._manipulability = kinematics.manipulability(self._positions)
        speed = arm.model.velocity
        self._largest_step = self.streaming.speed_share * self.streaming.period * speed
        self._largest_change = self.streaming.period**2 * arm.model.acceleration
        self._step: NDArray[np.float64] = np.zeros_like(speed)

    @property
    def step_time(self) -> float:
        """The seconds of motion per period; fewer if an operator has slowed the arm down."""
        return self.streaming.period * self._arm.speed_share

    def measured(self) -> Pose:
        """Return the measured tool pose."""
        return self._kinematics.tool_pose(self._arm.positions())

    def send(self, base_from_tool: Pose, posture: NDArray[np.float64] | None = None) -> StreamStep:
        """Request the next pose. Raises CommandRefusedError if the arm accepts no commands.

        ``posture``: (n,) radians, approached in the null space of the tool motion (Liégeois, 1977).
        """
        start = self._positions if posture is None else self._positions + self._towards(posture)
        positions = self._kinematics.track(base_from_tool, start)
        if positions is None:
            return StreamStep.UNREACHABLE
        step = positions - self._positions
        quicker = np.abs(step) - np.abs(self._step)
        if np.any(np.abs(step) > self._largest_step) or np.any(quicker > self._largest_change):
            return StreamStep.TOO_FAST
        manipulability = self._kinematics.manipulability(positions)
        if manipulability < min(self.streaming.min_manipulability, self._manipulability):
            return StreamStep.UNREACHABLE
        self._arm.servo(positions)
        self._positions, self._step = positions, step
        self.pose, self._manipulability = base_from_tool, manipulability
        return StreamStep.SENT

    def _towards(self, posture: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a step (n,) in the null space of the tool's motion: at most a third of what each joint may do now."""
        wanted = self.streaming.posture_rate * self.streaming.period * (posture - self._positions)
        jacobian = self._kinematics.jacobian(self._positions)
        step: NDArray[np.float64] = wanted - np.linalg.pinv(jacobian, rcond=1e-3) @ (jacobian @ wanted)
        most = np.minimum(self._largest_step, np.abs(self._step) + self._largest_change)
        return step * min(1.0, 1.0 / max(float(np.abs(3.0 * step / most).max()), 1e-9))


Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guarding:
    """Parameters of guarded moves.

    ``acceleration``: m/s². ``force_filter``: seconds. ``blind_way``: metres at the start without force checks.
    ``any_direction``: multiple of the stop force that stops the move for any direction, in case of a wrong sign or a
    sliding contact.
    """

    acceleration: float = 0.2
    force_filter: float = 0.02
    blind_way: float = 0.0
    any_direction: float = 1.5


@dataclass(frozen=True, eq=False)
class GuardedOutcome:
    """The result of a guarded move. ``touched``: whether the force was reached. ``distance``: distance moved by the
    tool, metres.

    ``force``: (3,) newtons, in the base frame, of the environment on the hand, relative to the start. ``tool``:
    base_from_tool at the end.
    """

    touched: bool
    distance: float
    force: Array
    tool: Pose


class GuardedMove:
    """A running guarded move; ``tick`` is called every period of the stream until it returns False."""

    def __init__(
        self,
        stream: ToolStream,
        wrist: WristWrench,
        direction: Array,
        speed: float,
        max_distance: float,
        stop_force: float,
        motion: Motion[GuardedOutcome],
        guarding: Guarding = Guarding(),
    ) -> None:
        self._stream, self._wrist, self._motion = stream, wrist, motion
        self._direction, self._target_speed = direction, speed
        self._max_distance, self._stop_force = max_distance, stop_force
        self._guarding = guarding
        self._start = stream.measured()
        self._initial = wrist.contact_at(self._start).force
        self._force: Array = np.zeros(3)
        self._speed = 0.0

    def tick(self) -> bool:
        """Run one period; return False when the move has ended."""
        period, p = self._stream.streaming.period, self._guarding
        tool = self._stream.measured()
        share = period / (period + p.force_filter)
        self._force = self._force + share * (self._wrist.contact_at(tool).force - self._initial - self._force)
        distance = float((tool.position - self._start.position) @ self._direction)
        opposing = -float(self._force @ self._direction)
        felt = opposing >= self._stop_force or np.linalg.norm(self._force) >= p.any_direction * self._stop_force
        touched = bool(distance >= p.blind_way and felt)
        left = self._max_distance - float((self._stream.pose.position - self._start.position) @ self._direction)
        if touched or left <= 1e-4:
            self._motion.succeed(GuardedOutcome(touched, distance, self._force, tool))
            return False
        time = self._stream.step_time
        self._speed = min(self._speed + p.acceleration * time, self._target_speed, (2 * p.acceleration * left) ** 0.5)
        for slower in (1.0, 0.5, 0.2):
            way = min(slower * self._speed * time, left) * self._direction
            pose = self._stream.pose
            if self._stream.send(Pose(pose.position + way, pose.quaternion)) is StreamStep.SENT:
                return True
        text = f"the arm can go no further than {distance:.3f} m: a joint limit or a singularity is ahead"
        self._motion.fail(MotionErrorCode.UNREACHABLE, text, GuardedOutcome(False, distance, self._force, tool))
        return False


def check_positive(**values: float) -> None:
    """Raise ValueError for a value that is not greater than 0."""
    for name, value in values.items():
        if not value > 0.0:
            raise ValueError(f"{name} should be positive but is {value!r}")
