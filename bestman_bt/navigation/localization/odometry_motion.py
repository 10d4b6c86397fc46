"""The odometry motion model of Thrun, Burgard, Fox, Probabilistic Robotics, table 5.6: turn, drive, turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.messages.bounds import NonNegative


@dataclass(frozen=True)
class OdometryMotion:
    """Standard deviations, in radians and metres per radian turned and metre driven.

    ``still_turn`` (radians) and ``still_drive`` (metres) are added to every step: they keep particles from becoming
    one.
    """

    turn_per_turn: Annotated[NonNegative, "rad/rad"] = 0.12
    turn_per_metre: Annotated[NonNegative, "rad/m"] = 0.08
    drive_per_metre: Annotated[NonNegative, "m/m"] = 0.12
    drive_per_turn: Annotated[NonNegative, "m/rad"] = 0.01
    still_turn: Annotated[NonNegative, "rad"] = 0.002
    still_drive: Annotated[NonNegative, "m"] = 0.002

    def sample(self, poses: NDArray[np.float64], moved: Pose2D, rng: np.random.Generator) -> NDArray[np.float64]:
        """Where each of ``poses`` (N, 3) of x, y, theta may be after ``moved`` by the odometry, in the base frame."""
        drive = math.hypot(moved.x, moved.y)
        # A step too short to have a direction is none; the noise of a standing base must not turn it about.
        first = math.atan2(moved.y, moved.x) if drive > 1e-3 else 0.0
        second = wrap_angle(moved.theta - first)
        # Backwards, the turns are those to the opposite direction: small, and so is their noise.
        turn_1, turn_2 = (min(abs(turn), abs(wrap_angle(turn - math.pi))) for turn in (first, second))
        std_1 = self.turn_per_turn * turn_1 + self.turn_per_metre * drive + self.still_turn
        std_2 = self.turn_per_turn * turn_2 + self.turn_per_metre * drive + self.still_turn
        std_drive = self.drive_per_metre * drive + self.drive_per_turn * (turn_1 + turn_2) + self.still_drive
        noise = rng.standard_normal((3, len(poses)))
        heading = poses[:, 2] + first + std_1 * noise[0]
        driven = drive + std_drive * noise[1]
        moved_poses = np.empty_like(poses)
        moved_poses[:, 0] = poses[:, 0] + driven * np.cos(heading)
        moved_poses[:, 1] = poses[:, 1] + driven * np.sin(heading)
        moved_poses[:, 2] = heading + second + std_2 * noise[2]
        return moved_poses
