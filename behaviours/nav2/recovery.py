"""Asking whether a recovery may help: IsStuck, WouldAPlannerRecoveryHelp, WouldAControllerRecoveryHelp, …"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.nav2.ports import SERVICE, without_meaning
from behaviours.navigation.localise import Relocalise
from behaviours.skill import InstantSkill, SkillCondition
from bestman_bt.engine import BoundedPort, In, InOut
from bestman_bt.messages import Pose2D
from bestman_bt.messages.shapes import Positive

# Forgetting what the lidar has seen: ClearEntireCostmap and its kin. What is still there is seen again at once.


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


class AreErrorCodesPresent(SkillCondition):
    """Whether an ``error_code`` is one of ``error_codes_to_check``."""

    error_code = InOut(str, "of the leaf that failed", default="")
    error_codes_to_check = In(list[str], "code;code", required=False)
    CODES: ClassVar[tuple[str, ...]] = ()
    """What is looked for where the port names none."""

    FAILS: ClassVar = {"other_code": "the failure is of another kind; nothing is wrong"}

    def check(self) -> tuple[str, str] | None:
        """Compares."""
        code = self.error_code
        if code in (self.error_codes_to_check or self.CODES):
            return None
        return "other_code", f"{code!r} is none of them" if code else "there is no error code"


class WouldAPlannerRecoveryHelp(AreErrorCodesPresent):
    """Whether planning failed for a reason that may go away: something is in the way, and not the goal off the map."""

    CODES: ClassVar = ("no_path", "start_blocked", "goal_blocked", "arm_in_the_way")


class WouldAControllerRecoveryHelp(AreErrorCodesPresent):
    """Whether driving failed for a reason that may go away."""

    CODES: ClassVar = ("blocked", "tolerance", "no_path", "path_blocked")


class ReinitializeGlobalLocalization(Relocalise):
    """Relocalise by Nav2's name: where the base is is sought on the whole map."""

    INPUT_PORTS: ClassVar = {**SERVICE}


class WouldASmootherRecoveryHelp(AreErrorCodesPresent):
    """Whether smoothing failed for a reason that may go away."""

    CODES: ClassVar = ("failed", "path_blocked", "timeout")


class WouldARouteRecoveryHelp(AreErrorCodesPresent):
    """Whether a route failed for a reason that may go away."""

    CODES: ClassVar = ("no_path", "timeout")


class IsStuck(SkillCondition):
    """True from when a commanded base has stalled, or was stopped harder than it brakes, until it moves again."""

    REQUIRES = ("base", "lidar")
    FAILS: ClassVar = {"not_stuck": "nothing is wrong"}

    def check(self) -> tuple[str, str] | None:
        """Asks the base's controller."""
        if self.skills.base.stuck:
            return None
        return "not_stuck", "the base moves as it is told"
