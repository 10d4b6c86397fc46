"""Simulated arms: joint groups that also follow trajectories and streamed set-points."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory
from hal.api import Arm, Motion
from hal.pybullet.joint_group import SimulatedJointGroup
from hal.pybullet.motion import SimulatedMotion
from hal.pybullet.setpoints import Follow, Stream
from hal.pybullet.simulation import Simulation

START_TOLERANCE = 0.05
SPEED_TOLERANCE = 1.02
LONGEST_STREAM_INTERVAL = 0.1


class SimulatedArm(SimulatedJointGroup, Arm):
    """An arm."""

    kind: ClassVar[str] = "arm"
    _streamed_at = -np.inf
    _segment: tuple[NDArray[np.float64], NDArray[np.float64], int] | None = None  # start, step, steps sent

    def follow(self, trajectory: JointTrajectory) -> Motion:
        """Follow a trajectory; a start that is a little off fades out in the first quarter of a second."""
        self._connection.check_command("follow")
        self._check_trajectory(trajectory)
        start = trajectory.positions[0]
        measured = self.positions()
        worst = int(np.argmax(np.abs(start - measured)))
        if abs(start[worst] - measured[worst]) > START_TOLERANCE:
            raise self._connection.refuse(
                "follow",
                f"the trajectory starts with {self.joint_names[worst]} = {start[worst]:.4f}, but it is at "
                f"{measured[worst]:.4f}; within {START_TOLERANCE} would be accepted",
            )
        motion = SimulatedMotion(self)
        self._take_over(Follow(trajectory, self._position - start, 0.25), motion)
        return motion

    def servo(self, positions: ArrayLike) -> None:
        """Stream one set-point: it is reached after the time since the last one (at most 0.1 s)."""
        simulation = self._connection.check_command("servo")
        target = self._checked_positions("servo", positions)
        now = simulation.steps * self._parameters.time_step
        interval = min(max(now - self._streamed_at, self._parameters.control_period), LONGEST_STREAM_INTERVAL)
        speed = np.abs(target - self._position) / interval
        worst = int(np.argmax(speed / self._speed))
        if speed[worst] > self._speed[worst] * SPEED_TOLERANCE:
            raise self._connection.refuse(
                "servo",
                f"{self.joint_names[worst]} would need {speed[worst]:.3f} rad/s, its limit is "
                f"{self._speed[worst]:.3f} rad/s",
            )
        self._streamed_at = now
        self._take_over(Stream(self._position, target, interval), None)

    def attach(self, simulation: Simulation) -> None:
        """Hold where the joints are."""
        self._segment = None
        super().attach(simulation)
        simulation.effort_controls.append(self._interpolate)

    def _send(self, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> None:
        """Streamed set-points are interpolated at the physics rate, as the drives of real arms do.

        Steps at the control rate would shake what the hand holds, and it would work its way out of the fingers.
        """
        if isinstance(self._setpoints, Stream):
            self._segment = self._position, (position - self._position) / self._parameters.control_every, 0
        else:
            self._segment = None
            super()._send(position, velocity)

    def _interpolate(self) -> None:
        if self._segment is None or self._torques is not None:
            return
        start, step, sent = self._segment
        if sent < self._parameters.control_every:
            self._segment = start, step, sent + 1
            super()._send(start + (sent + 1) * step, step * self._parameters.step_rate)

    def _check_trajectory(self, trajectory: JointTrajectory) -> None:
        if trajectory.joint_names != self.joint_names:
            raise self._connection.refuse(
                "follow", f"the joints are {trajectory.joint_names}, but this arm's are {self.joint_names}"
            )
        pairs = [(trajectory.positions, self._lower, self._upper, "position")]
        speeds = [trajectory.velocities]
        if len(trajectory.times) > 1:
            speeds.append(np.diff(trajectory.positions, axis=0) / np.diff(trajectory.times)[:, None])
        limit = self._speed * SPEED_TOLERANCE
        pairs += [(speed, -limit, limit, "velocity") for speed in speeds]
        for values, lower, upper, what in pairs:
            wrong = ~((values >= lower - 1e-6) & (values <= upper + 1e-6))
            if np.any(wrong):
                sample, joint = (int(index) for index in np.argwhere(wrong)[0])
                raise self._connection.refuse(
                    "follow",
                    f"{what} of {self.joint_names[joint]} in sample {sample} is {values[sample, joint]:.4f}, its "
                    f"limits are [{lower[joint]:.4f}, {upper[joint]:.4f}]",
                )
