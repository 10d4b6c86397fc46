"""Forgetting what the lidar has seen: ClearEntireCostmap and its kin. What is still there is seen again at once."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.nav2.ports import SERVICE, without_meaning
from behaviours.skill import InstantSkill
from bestman_bt.engine import BoundedPort, In
from bestman_bt.messages import Pose2D
from bestman_bt.messages.bounds import Positive

PORTS = {**SERVICE, **without_meaning("plugins")}
RESET_DISTANCE = BoundedPort(Positive, required=False, default_value=1.0, description="metres, the side of a square")


class ClearEntireCostmap(InstantSkill):
    """Forget all obstacles that were seen; what the map has stays."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = PORTS

    def act(self) -> None:
        """Forget them."""
        self.skills.base.layer.clear()


class ClearCostmap(ClearEntireCostmap):
    """ClearEntireCostmap by its short name."""


class ClearCostmapAroundRobot(InstantSkill):
    """Forget the obstacles that were seen in a square around the base."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**PORTS, "reset_distance": RESET_DISTANCE}

    def act(self) -> None:
        """Forget them."""
        self.skills.base.layer.clear(lambda points: _within(points, self._centre(), self.get_input("reset_distance")))

    def _centre(self) -> Pose2D:
        return self.skills.world.base.pose


class ClearCostmapAroundPose(ClearCostmapAroundRobot):
    """Forget the obstacles that were seen in a square around a pose."""

    pose = In(Pose2D, "x;y;theta in the map frame")

    def _centre(self) -> Pose2D:
        pose: Pose2D = self.pose
        return pose


class ClearCostmapExceptRegion(InstantSkill):
    """Forget the obstacles that were seen, but for those in a square around the base."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**PORTS, "reset_distance": RESET_DISTANCE}

    def act(self) -> None:
        """Forget them."""
        pose, side = self.skills.world.base.pose, self.get_input("reset_distance")
        self.skills.base.layer.clear(lambda points: ~_within(points, pose, side))


def _within(points: NDArray[np.float64], centre: Pose2D, side: float) -> NDArray[np.bool_]:
    """Which points (N, 2) lie in a square of the map's axes."""
    inside: NDArray[np.bool_] = np.all(np.abs(points - centre.xy) <= side / 2, axis=1)
    return inside
