"""Kinematic rollouts of a policy: the executed part of each chunk is followed exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.policy.base import Observation, Policy
from bestman_bt.manipulation.policy.chunk_stream import chunk_path
from bestman_bt.manipulation.policy.features import pose_error, pose_vector
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel


@dataclass(frozen=True, eq=False)
class Rollout:
    """``path``: (N, n) radians; ``errors``: (C, 2) metres and radians to the goal after each chunk."""

    path: NDArray[np.float64]
    errors: NDArray[np.float64]

    def reached(self, position_tolerance: float, rotation_tolerance: float) -> bool:
        """Return whether the tool was at the goal after some chunk."""
        return bool((self.errors <= (position_tolerance, rotation_tolerance)).all(axis=1).any())


def roll_out(
    policy: Policy,
    kinematics: InverseKinematics,
    arm: ArmModel,
    start: NDArray[np.float64],
    goal: Pose,
    judged: Pose | None = None,
    chunks: int = 16,
) -> Rollout:
    """Run a policy from ``start`` (n,), radians, to ``goal``. Errors are relative to ``judged`` (default: ``goal``)."""
    judged = judged or goal
    path, errors = [start], []
    velocities = np.zeros(len(start))
    policy.reset()
    for _ in range(chunks):
        tool = kinematics.tool_pose(path[-1])
        chunk = policy.act(Observation(path[-1], tool, pose_vector(goal), joint_velocities=velocities))
        steps = chunk_path(chunk, path[-1], kinematics, arm)
        done = policy.specification.executed or max(1, (len(steps) - 1) // 2)
        path.extend(steps[1 : done + 1])
        velocities = (steps[min(done + 1, len(steps) - 1)] - steps[done - 1]) / (2.0 * chunk.dt)
        error = pose_error(judged, kinematics.tool_pose(path[-1]))
        errors.append((np.linalg.norm(error[:3]), np.linalg.norm(error[3:])))
    return Rollout(np.array(path), np.array(errors))
