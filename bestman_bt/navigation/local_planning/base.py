"""Path followers: from the present pose and velocity to the next velocity command."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from bestman_bt.messages import Path2D, Pose2D, Twist2D


@dataclass(frozen=True)
class FollowerCommand:
    """What to do until the next call.

    ``twist``: velocity command in the base frame. ``done``: the goal is reached and the twist is zero.
    ``remaining``: metres of path that are left.
    """

    twist: Twist2D
    done: bool
    remaining: float


class PathFollower(ABC):
    """Follows one path at a time; holds the progress along it and nothing else."""

    @abstractmethod
    def reset(self, path: Path2D) -> None:
        """Begin ``path``; ValueError if it has no point."""

    @abstractmethod
    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        """The next command.

        ``pose``: in the map frame. ``velocity``: measured, in the base frame. ``dt``: seconds until the next call;
        the command differs from the last one by no more than the acceleration limits allow in that time.
        Raises RuntimeError before the first ``reset``.
        """
