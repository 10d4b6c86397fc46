"""Arms over a channel: streamed joints that follow trajectories, with limits on where the tool goes and how fast."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model import ArmModel
from hal.api import Arm, Motion, MotionErrorCode
from hal.parts.channels import JointChannel
from hal.parts.setpoints import Drift, Follow, Stream, Trapezoid
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_joints import StreamedJointGroup, Tracking
from hal.parts.tool_limits import ToolLimits

Array = NDArray[np.float64]
SAMPLES = 25
"""Samples of a motion at which the speed of the tool is looked at."""


class StreamedArm(StreamedJointGroup, Arm):
    """An arm over a channel; its tool stays in the workspace and below its top speed.

    ``now``: the time by which set-points of ``servo`` follow each other, seconds; that of the cycles by default.
    """

    kind: ClassVar[str] = "arm"
    model: ArmModel

    def __init__(
        self,
        name: str,
        model: ArmModel,
        channel: JointChannel,
        latch: StopLatch,
        period: float,
        tool: ToolLimits,
        tracking: Tracking | None = None,
        now: Callable[[], float] | None = None,
    ) -> None:
        super().__init__(name, model, channel, latch, period, tracking or Tracking())
        self._tool, self.latency = tool, self._tracking.latency
        self._pace = 1.0  # of the trajectory under way
        self._streamed_at = -np.inf
        self._time = 0.0  # of the cycles
        self._now = now or self._time_of_cycles

    def follow(self, trajectory: JointTrajectory) -> Motion[None]:
        """Follow a trajectory, slower where the tool would be too fast; a start that is a little off fades out."""
        with self._connection.lock:
            self._connection.check_command("follow")
            self._checks.trajectory(trajectory, self.positions())
            fault = next(filter(None, map(self._tool.outside, trajectory.positions)), None)
            if fault is not None:
                raise self._connection.refuse("follow", fault)
            self._leave_effort_mode()
            self._start_from_rest()
            self._pace = self._tool.slow_down(trajectory.positions, trajectory.velocities)
            if self._pace < 1.0:
                trajectory = JointTrajectory(
                    trajectory.joint_names,
                    trajectory.times / self._pace,
                    trajectory.positions,
                    trajectory.velocities * self._pace,
                )
            motion: Motion[None] = Motion(self.name, self.brake)
            self._take_over(Follow(trajectory, self._position - trajectory.positions[0], 0.25), motion)
            return motion

    def trajectory_time(self) -> float | None:
        """What the set-points had come to when the joints were last read."""
        with self._connection.lock:
            if not isinstance(self._setpoints, Follow):
                return None
            return max(0.0, self._setpoints.time - self._channel.age) * self._pace

    def servo(self, positions: ArrayLike) -> None:
        """Stream one set-point: it is reached after the time since the last one (at most 0.1 s)."""
        with self._connection.lock:
            self._connection.check_command("servo")
            target = self._checks.positions("servo", positions)
            longest = self._tracking.longest_stream_interval
            interval = min(max(self._now() - self._streamed_at, self._period), longest)
            self._leave_effort_mode()
            self._start_from_rest()
            self._checks.servo(target, self._position, interval)
            fault = self._tool.outside(target)
            if fault is None and self._tool.slow_down(target[None], (target - self._position)[None] / interval) < 1.0:
                fault = "the tool would be faster than its limit"
            if fault is not None:
                raise self._connection.refuse("servo", fault)
            self._streamed_at = self._now()
            self._take_over(Stream(self._position, target, interval), None)

    def cycle(self, elapsed: float) -> None:
        """One control period."""
        self._time += elapsed
        super().cycle(elapsed)

    def _time_of_cycles(self) -> float:
        return self._time

    def _advance(self, elapsed: float) -> None:
        super()._advance(elapsed)
        if isinstance(self._setpoints, Drift) and (fault := self._tool.outside(self._position)) is not None:
            self._give_up(MotionErrorCode.FAULT, fault)

    def _check_way(self, command: str, target: Array) -> None:
        fault = self._tool.outside_on_the_way(self._position, target)
        if fault is not None:
            raise self._connection.refuse(command, fault)

    def _slow_down(self, profile: Trapezoid) -> float:
        if not self._tool.needed:
            return 1.0
        samples = [profile.advance(profile.duration / SAMPLES) for _ in range(SAMPLES)]
        return self._tool.slow_down(*(np.array(column) for column in zip(*samples, strict=True)))
