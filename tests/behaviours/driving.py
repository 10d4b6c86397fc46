"""Drives in the kitchen: where to, and whether the robot has come there."""

from __future__ import annotations

from bestman_bt.messages import Pose2D
from hal.simulation.ground_truth import GroundTruth

BEFORE_THE_DOORWAY = "robot_start: {x: [-1.3, -1.3], y: [0.0, 0.0], yaw: [0.0, 0.0]}"
BEHIND_THE_DOORWAY = "1.2;0.0;0.0"


def to(goal: str, replans: int = 3) -> str:
    """The leaf that drives to ``x;y;theta``."""
    return f'<NavigateTo goal="{goal}" max_replans="{replans}"/>'


def at(truth: GroundTruth, goal: str) -> bool:
    """Whether the robot really is there."""
    return truth.base_pose().to_pose2d().distance_to(Pose2D(*map(float, goal.split(";")))) < 0.02
