"""Arms over a channel: streamed joints that follow trajectories, with limits on where the tool goes and how fast."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model import ArmModel, RobotModel
from bestman_bt.robot_model.connection_config import SafetyConfig
from hal.api import Arm, Motion, MotionErrorCode
from hal.parts.channels import JointChannel
from hal.parts.setpoints import Drift, Follow, Stream, Trapezoid
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_joints import StreamedJointGroup, Tracking

if TYPE_CHECKING:
    import pinocchio


# Where an arm's tool is and how fast it moves, held to the workspace and the speed of the robot's ``safety``.


Array = NDArray[np.float64]


class ToolLimits:
    """Checks joint positions (n,) of one arm. The pose of other joints between base and arm is taken as ``home``.

    ``top_speed``: m/s; None where nothing is said. Kinematics by pinocchio on the robot's URDF; both
    are loaded when first needed.
    """

    def __init__(self, model: RobotModel, arm: str, safety: SafetyConfig) -> None:
        self._robot, self._arm, self._safety = model, model.of(ArmModel)[arm], safety
        self.top_speed = safety.tool_speed
        self._model: pinocchio.Model | None = None

    @property
    def needed(self) -> bool:
        """Whether there is anything to hold the tool to."""
        return self._safety.workspace is not None or self._safety.tool_speed is not None

    def outside(self, positions: Array) -> str | None:
        """Where the tool would leave the workspace, in words, else None."""
        box = self._safety.workspace
        if box is None:
            return None
        tool = self.tool(positions)
        for axis, value, lower, upper in zip("xyz", tool, box.lower, box.upper, strict=True):
            if not lower <= value <= upper:
                return f"the tool would be at {axis} = {value:.3f} m, its workspace is [{lower:.3f}, {upper:.3f}] m"
        return None

    def outside_on_the_way(self, start: Array, end: Array) -> str | None:
        """As ``outside``, on the straight line in joint space; sampled every 0.05 rad."""
        if self._safety.workspace is None:
            return None
        count = 1 + int(np.ceil(np.max(np.abs(end - start)) / 0.05))
        faults = (self.outside(start + share * (end - start)) for share in np.linspace(1.0, 0.0, count, endpoint=False))
        return next((fault for fault in faults if fault is not None), None)

    def slow_down(self, positions: Array, velocities: Array) -> float:
        """The share, within (0, 1], of its speed at which a motion through these samples, (N, n) each, may run."""
        limit = self._safety.tool_speed
        if limit is None:
            return 1.0
        fastest = max(self.tool_speed(q, v) for q, v in zip(positions, velocities, strict=True))
        return min(1.0, limit / max(fastest, 1e-9))

    def tool(self, positions: Array) -> Array:
        """The tool in the robot's base frame, (3,) metres."""
        import pinocchio

        model, data, q = self._at(positions)
        pinocchio.framesForwardKinematics(model, data, q)
        base, tool = data.oMf[self._base], data.oMf[self._tool]
        place: Array = np.asarray(base.actInv(tool).translation).copy()
        return place

    def tool_speed(self, positions: Array, velocities: Array) -> float:
        """Speed of the tool relative to the base, m/s, when only this arm moves."""
        import pinocchio

        model, data, q = self._at(positions)
        jacobian = pinocchio.computeFrameJacobian(model, data, q, self._tool, pinocchio.LOCAL_WORLD_ALIGNED)
        return float(np.linalg.norm(jacobian[:3, self._columns] @ velocities))

    def _at(self, positions: Array) -> tuple[pinocchio.Model, pinocchio.Data, Array]:
        if self._model is None:
            self._load()
        q = self._neutral.copy()
        q[self._slots] = positions
        return self._model, self._data, q

    def _load(self) -> None:
        import pinocchio

        model = pinocchio.buildModelFromXML(self._robot.urdf)
        joints = [model.joints[model.getJointId(name)] for name in self._arm.joint_names]
        self._slots = [joint.idx_q for joint in joints]
        self._columns = [joint.idx_v for joint in joints]
        self._base, self._tool = model.getFrameId(self._robot.base_frame), model.getFrameId(self._arm.tool_frame)
        self._neutral: Array = pinocchio.neutral(model)
        for name, value in self._robot.postures.get("home", {}).items():
            if model.existJointName(name):
                self._neutral[model.joints[model.getJointId(name)].idx_q] = value
        self._model, self._data = model, model.createData()


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
