"""Simulated arms: joint groups that also follow trajectories and streamed set-points."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory
from hal.api import Arm, Motion
from hal.parts import Follow, PartMotion, Stream
from hal.pybullet.joint_group import SimulatedJointGroup
from hal.pybullet.simulation import Simulation

LONGEST_STREAM_INTERVAL = 0.1


class SimulatedArm(SimulatedJointGroup, Arm):
    """An arm."""

    kind: ClassVar[str] = "arm"
    _streamed_at = -np.inf
    _segment: tuple[NDArray[np.float64], NDArray[np.float64], int] | None = None  # start, step, steps sent

    def follow(self, trajectory: JointTrajectory) -> Motion:
        """Follow a trajectory; a start that is a little off fades out in the first quarter of a second."""
        self._connection.check_command("follow")
        self._checks.trajectory(trajectory, self.positions())
        start = trajectory.positions[0]
        motion = PartMotion(self)
        self._take_over(Follow(trajectory, self._position - start, 0.25), motion)
        return motion

    def servo(self, positions: ArrayLike) -> None:
        """Stream one set-point: it is reached after the time since the last one (at most 0.1 s)."""
        simulation = self._connection.check_command("servo")
        target = self._checks.positions("servo", positions)
        now = simulation.steps * self._parameters.time_step
        interval = min(max(now - self._streamed_at, self._parameters.control_period), LONGEST_STREAM_INTERVAL)
        self._checks.servo(target, self._position, interval)
        self._streamed_at = now
        self._take_over(Stream(self._position, target, interval), None)

    def attach(self, simulation: Simulation) -> None:
        """Hold where the joints are."""
        self._segment = None
        super().attach(simulation)
        simulation.effort_controls.append(self._interpolate)

    def _send(self, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> None:
        """Set-points are interpolated at the physics rate, as the drives of real arms do.

        Steps at the control rate would shake what the hand holds, and it would work its way out of the fingers.
        """
        self._segment = self._position, (position - self._position) / self._parameters.control_every, 0

    def _interpolate(self) -> None:
        if self._segment is None or self._torques is not None:
            return
        start, step, sent = self._segment
        if sent < self._parameters.control_every:
            self._segment = start, step, sent + 1
            super()._send(start + (sent + 1) * step, step * self._parameters.step_rate)
