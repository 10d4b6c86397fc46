"""Nav2's recoveries: clearing of the costmap, and conditions that select a recovery.

Cleared obstacles that still exist are seen again immediately.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.nav2.ports import SERVICE, without_meaning
from behaviours.navigation.localise import Relocalise
from behaviours.skill import InstantSkill, SkillCondition
from bestman_bt.engine import In, InOut
from bestman_bt.messages import Pose2D
from bestman_bt.messages.shapes import Positive

PORTS = {**SERVICE, **without_meaning("plugins")}
RESET_DISTANCE = In[float](Positive, "metres, the side of a square", default=1.0)


class ClearEntireCostmap(InstantSkill):
    """Forget all seen obstacles; those of the map remain."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = PORTS

    def act(self) -> None:
        """Clear the obstacles."""
        self.skills.base.layer.clear()


class ClearCostmap(ClearEntireCostmap):
    """Alias of ClearEntireCostmap."""


class ClearCostmapAroundRobot(InstantSkill):
    """Forget the seen obstacles in a square around the base."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = PORTS
    reset_distance = RESET_DISTANCE

    def act(self) -> None:
        """Clear the obstacles."""
        self.skills.base.layer.clear(lambda points: _within(points, self._centre(), self.reset_distance))

    def _centre(self) -> Pose2D:
        return self.skills.world.base.pose


class ClearCostmapAroundPose(ClearCostmapAroundRobot):
    """Forget the seen obstacles in a square around a pose."""

    pose = In(Pose2D, "x;y;theta in the map frame")

    def _centre(self) -> Pose2D:
        pose: Pose2D = self.pose
        return pose


class ClearCostmapExceptRegion(InstantSkill):
    """Forget the seen obstacles outside a square around the base."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = PORTS
    reset_distance = RESET_DISTANCE

    def act(self) -> None:
        """Clear the obstacles."""
        pose, side = self.skills.world.base.pose, self.reset_distance
        self.skills.base.layer.clear(lambda points: ~_within(points, pose, side))


def _within(points: NDArray[np.float64], centre: Pose2D, side: float) -> NDArray[np.bool_]:
    """Return which points (N, 2) lie in a square of the map's axes."""
    inside: NDArray[np.bool_] = np.all(np.abs(points - centre.xy) <= side / 2, axis=1)
    return inside


class AreErrorCodesPresent(SkillCondition):
    """Check whether an ``error_code`` is one of ``error_codes_to_check``."""

    error_code = InOut(str, "error code of the failed leaf", default="")
    error_codes_to_check = In(list[str], "code;code", required=False)
    CODES: ClassVar[tuple[str, ...]] = ()
    """Codes to check by default."""

    FAILS: ClassVar = {"other_code": "the failure has another code; this is a valid result"}

    def check(self) -> tuple[str, str] | None:
        """Return None if the error code is one of those to check."""
        code = self.error_code
        if code in (self.error_codes_to_check or self.CODES):
            return None
        return "other_code", f"{code!r} is none of them" if code else "there is no error code"


class WouldAPlannerRecoveryHelp(AreErrorCodesPresent):
    """Check whether planning failed for a temporary reason, such as an obstacle, but not a goal off the map."""

    CODES: ClassVar = ("no_path", "start_blocked", "goal_blocked", "arm_in_the_way")


class WouldAControllerRecoveryHelp(AreErrorCodesPresent):
    """Check whether driving failed for a temporary reason."""

    CODES: ClassVar = ("blocked", "tolerance", "no_path", "path_blocked")


class ReinitializeGlobalLocalization(Relocalise):
    """Search for the base on the whole map: Nav2's name of ``Relocalise``."""

    INPUT_PORTS: ClassVar = {**SERVICE}


class WouldASmootherRecoveryHelp(AreErrorCodesPresent):
    """Check whether smoothing failed for a temporary reason."""

    CODES: ClassVar = ("failed", "path_blocked", "timeout")


class WouldARouteRecoveryHelp(AreErrorCodesPresent):
    """Check whether a route failed for a temporary reason."""

    CODES: ClassVar = ("no_path", "timeout")


class IsStuck(SkillCondition):
    """True while a commanded base is stalled, or after a harder stop than its braking limit, until it moves again."""

    REQUIRES = ("base", "lidar")
    FAILS: ClassVar = {"not_stuck": "nothing is wrong"}

    def check(self) -> tuple[str, str] | None:
        """Return None if the base's controller reports a stalled base."""
        if self.skills.base.stuck:
            return None
        return "not_stuck", "the base moves as commanded"
