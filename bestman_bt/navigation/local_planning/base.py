"""Path followers: from the current pose and velocity to the next velocity command."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from bestman_bt.messages import LaserScan, Path2D, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.robot_model.model import BaseModel


@dataclass(frozen=True)
class FollowerCommand:
    """A velocity command, valid until the next call.

    ``twist``: in the base frame. ``done``: the goal is reached and the twist is zero. ``remaining``: length of the
    remaining path, metres.
    """

    twist: Twist2D
    done: bool
    remaining: float


class PathFollower(ABC):
    """Follows one path at a time; its only state is the progress along it.

    Obstacle-avoiding followers get the base (``configure``) and the scans (``observe``); others inherit both without
    effect.
    """

    def configure(self, base: BaseModel) -> None:
        """Set the model of the base; called once, before the first ``reset``."""
        return

    def observe(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Process a new scan and its pose."""
        return

    @abstractmethod
    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        """Start following ``path``.

        Raises ValueError if it has no points. ``costmap``: used for planning, if known.
        """

    @abstractmethod
    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        """Return the next command.

        ``pose``: in the map frame. ``velocity``: measured, in the base frame. ``dt``: seconds until the next call;
        the command differs from the last one by no more than the acceleration limits allow in that time.
        Raises RuntimeError before the first ``reset``.
        """
