"""Simulated arms: joint groups that also follow trajectories and streamed set-points."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bestman_bt.messages import JointTrajectory
from hal.api import Arm, Motion
from hal.parts import Follow, PartMotion, Stream
from hal.pybullet.joint_group import SimulatedJointGroup

LONGEST_STREAM_INTERVAL = 0.1


class SimulatedArm(SimulatedJointGroup, Arm):
    """An arm."""

    kind: ClassVar[str] = "arm"
    _streamed_at = -np.inf

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
