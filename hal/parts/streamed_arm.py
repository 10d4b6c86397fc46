"""Arms over a channel: streamed joints that follow trajectories, with limits on the position and speed of the tool."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.model import ArmModel
from hal.api import Arm, Motion
from hal.parts.channels import JointChannel
from hal.parts.gate import ToolLimits
from hal.parts.setpoints import Follow, Hold, Stream, Trapezoid
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_joints import StreamedJointGroup, Tracking

Array = NDArray[np.float64]
SAMPLES = 25
"""Number of samples of a motion at which the tool speed is checked."""


class StreamedArm(StreamedJointGroup, Arm):
    """An arm over a channel; tool and elbow stay in the workspace, the tool below its top speed.

    ``now``: the clock that times the set-points of ``servo``, seconds; that of the cycles by default. ``send_load``:
    for controllers that need the held load: sends its mass, kg, and its centre in the tool frame.
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
        super().__init__(name, model, channel, latch, period, tracking or Tracking(), tool)
        self._tool, self.latency = tool, self._tracking.latency
        self._pace = 1.0  # of the trajectory under way
        self._streamed_at = -np.inf
        self._time = 0.0  # of the cycles
        self._now = now or self._time_of_cycles
        self.send_load: Callable[[float, ArrayLike], None] | None = None
        self.load: tuple[float, ArrayLike] | None = None  # the latest of ``carry``

    def follow(self, trajectory: JointTrajectory) -> Motion[None]:
        """Follow a trajectory, slowed down where it would exceed a limit; a small initial offset is reduced gradually.

        Raises CommandRefusedError as ``Arm.follow`` does, and if the tool would leave its workspace.
        """
        self._check_trajectory(trajectory)
        # Of a long one this takes a while, for which set-points and stops must not wait.
        places, speeds, accelerations = _between(trajectory)
        if self._tool.box is not None:
            fault = next(filter(None, map(self._tool.outside, places)), None)
            if fault is not None:
                raise self._connection.refuse("follow", fault)
        pace = min(self._joint_pace(speeds, accelerations), self._tool.slow_down(places, speeds))
        with self._connection.lock:
            self._check_trajectory(trajectory)
            self._leave_effort_mode()
            self._start_from_rest()
            self._pace = pace
            if pace < 1.0:
                trajectory = JointTrajectory(
                    trajectory.joint_names, trajectory.times / pace, trajectory.positions, trajectory.velocities * pace
                )
            motion: Motion[None] = Motion(self.name, self.brake)
            self._take_over(Follow(trajectory, self._position - trajectory.positions[0], 0.25), motion)
            return motion

    def _check_trajectory(self, trajectory: JointTrajectory) -> None:
        self._connection.check_command("follow")
        self._checks.trajectory(trajectory, self.positions())

    @override
    def carry(self, mass: float, centre: ArrayLike) -> None:
        self.load = mass, centre
        if self.send_load is not None and self._connection.connected:
            self.send_load(mass, centre)

    @override
    def attach(self) -> None:
        """Send the load again to a controller that has connected or recovered, then continue like
        ``StreamedJointGroup``.
        """
        if self.send_load is not None and self.load is not None:
            self.send_load(*self.load)
        super().attach()

    def trajectory_time(self) -> float | None:
        """Return the trajectory time of the set-points at the latest joint reading, seconds, or None."""
        with self._connection.lock:
            if not isinstance(self._setpoints, Follow):
                return None
            return max(0.0, self._setpoints.time - self._time_scale.share * self._channel.age) * self._pace

    def servo(self, positions: ArrayLike) -> None:
        """Stream one set-point (n,), to be reached within the time since the last one (at most 0.1 s)."""
        with self._connection.lock:
            self._connection.check_command("servo")
            target = self._checks.positions("servo", positions)
            longest = self._tracking.longest_stream_interval
            interval = min(max(self._now() - self._streamed_at, self._period), longest)
            self._start_from_rest()
            start = self._wanted if isinstance(self._setpoints, (Stream, Hold)) else self._start
            self._checks.servo(target, start, interval)
            fault = self._tool.outside(target)
            if fault is None and self._tool.slow_down(target[None], (target - start)[None] / interval) < 1.0:
                fault = "the tool would be faster than its limit"
            if fault is not None:
                raise self._connection.refuse("servo", fault)
            self._leave_effort_mode()
            self._streamed_at = self._now()
            self._take_over(Stream(start, target, interval), None)
            self._wanted = start

    @override
    def cycle(self, elapsed: float) -> None:
        self._time += elapsed
        super().cycle(elapsed)

    def _time_of_cycles(self) -> float:
        return self._time

    def _joint_pace(self, speeds: Array, accelerations: Array) -> float:
        """Return the fraction of its speed at which a trajectory keeps the limits of the joints."""
        fast = float(np.max(np.abs(speeds) / self.model.velocity))
        sudden = float(np.max(np.abs(accelerations) / self.model.acceleration))
        return min(1.0, 1.0 / max(fast, 1e-9), float(np.sqrt(1.0 / max(sudden, 1e-9))))

    def _check_way(self, command: str, target: Array) -> None:
        fault = self._tool.outside_on_the_way(self._start, target)
        if fault is not None:
            raise self._connection.refuse(command, fault)

    def _slow_down(self, profile: Trapezoid) -> float:
        if not self._tool.needed:
            return 1.0
        samples = [profile.advance(profile.duration / SAMPLES) for _ in range(SAMPLES)]
        return self._tool.slow_down(*(np.array(column) for column in zip(*samples, strict=True)))


def _between(trajectory: JointTrajectory) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations, (N, n) each, of a trajectory's samples and of three points
    between.
    """
    if len(trajectory.times) < 2:
        return trajectory.positions, trajectory.velocities, np.zeros_like(trajectory.positions)
    s = np.linspace(0.0, 1.0, 5)[:, None, None]
    h = np.diff(trajectory.times)[:, None]
    p0, p1 = trajectory.positions[:-1], trajectory.positions[1:]
    m0, m1 = trajectory.velocities[:-1] * h, trajectory.velocities[1:] * h
    rise, far = p1 - p0, m0 + m1 - 2.0 * (p1 - p0)
    places = p0 + s * (m0 + s * (rise - m0 - far + s * far))
    speeds = (m0 + s * (2.0 * (rise - m0 - far) + 3.0 * s * far)) / h
    accelerations = (2.0 * (rise - m0 - far) + 6.0 * s * far) / h**2
    n = places.shape[-1]
    return (
        places.swapaxes(0, 1).reshape(-1, n),
        speeds.swapaxes(0, 1).reshape(-1, n),
        accelerations.swapaxes(0, 1).reshape(-1, n),
    )
