"""Guarded moves: straight on until something is touched (Will and Grossman, 1975)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.arm.tool_stream import StreamStep, ToolStream
from bestman_bt.control.force_torque import WristWrench
from bestman_bt.messages import MotionErrorCode, Pose
from hal.api import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guarding:
    """How guarded moves go.

    ``acceleration``: m/s². ``force_filter``: seconds. ``blind_way``: metres at the start without a look at
    forces, for what the hand touches anyway while it gathers speed.
    """

    acceleration: float = 0.2
    force_filter: float = 0.02
    blind_way: float = 0.0


@dataclass(frozen=True, eq=False)
class GuardedOutcome:
    """``touched``: whether the force was met. ``distance``: metres that the tool went.

    ``force``: (3,) newtons, in the base frame, what the world did to the hand beyond what it did at the start.
    ``tool``: base_from_tool at the end.
    """

    touched: bool
    distance: float
    force: Array
    tool: Pose


class GuardedMove:
    """One move under way; ``tick`` is called every period of the stream, and answers False when it is over."""

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
        """One period."""
        period, p = self._stream.streaming.period, self._guarding
        tool = self._stream.measured()
        share = period / (period + p.force_filter)
        self._force = self._force + share * (self._wrist.contact_at(tool).force - self._initial - self._force)
        distance = float((tool.position - self._start.position) @ self._direction)
        opposing = -float(self._force @ self._direction)
        touched = distance >= p.blind_way and opposing >= self._stop_force
        left = self._max_distance - float((self._stream.pose.position - self._start.position) @ self._direction)
        if touched or left <= 1e-4:
            self._motion.succeed(GuardedOutcome(touched, distance, self._force, tool))
            return False
        self._speed = min(self._speed + p.acceleration * period, self._target_speed, (2 * p.acceleration * left) ** 0.5)
        for slower in (1.0, 0.5, 0.2):
            way = min(slower * self._speed * period, left) * self._direction
            pose = self._stream.pose
            if self._stream.send(Pose(pose.position + way, pose.quaternion)) is StreamStep.SENT:
                return True
        text = f"the arm can go no further than {distance:.3f} m: a joint limit or a singularity is ahead"
        self._motion.fail(MotionErrorCode.UNREACHABLE, text, GuardedOutcome(False, distance, self._force, tool))
        return False
