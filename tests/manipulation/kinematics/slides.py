"""Two slides on one line: the tool is at x = a + b, so that its paths can be worked out by hand."""

from __future__ import annotations

import numpy as np

from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics
from bestman_bt.messages import Pose
from tests.robot_models import joint_group_model

ONE = np.ones(2)
LIMITS = joint_group_model(("a", "b"))


def at(x: float, y: float = 0.0, yaw: float = 0.0) -> Pose:
    return Pose.from_xyz_rpy((x, y, 0.0), (0.0, 0.0, yaw))


class Slides(InverseKinematics):
    """What is missing is shared by both slides evenly; y and orientation of a pose are not looked at."""

    joint_names = ("a", "b")
    reach = (np.zeros(3), 2.0)

    def tool_pose(self, positions):
        return at(float(np.sum(positions)))

    def track(self, base_from_tool, start):
        found = np.asarray(start) + (base_from_tool.position[0] - np.sum(start)) / 2
        return found if np.abs(found).max() <= 1.0 else None

    def solve(self, base_from_tool, reference, rng, count=1, is_valid=None, attempts=None):
        found = self.track(base_from_tool, reference)
        solutions = [found + shift * np.array([1, -1]) for shift in (0.0, 0.3)[:count]] if found is not None else []
        solutions = [q for q in solutions if np.abs(q).max() <= 1.0 and (is_valid is None or is_valid(q))]
        return IKResult(tuple(solutions), 0.0, 0.0, 1)

    def tool_direction(self, positions, axis):
        return axis

    def jacobian(self, positions):
        return np.vstack([np.ones((1, 2)), np.zeros((5, 2))])

    def manipulability(self, positions):
        return 1.0
