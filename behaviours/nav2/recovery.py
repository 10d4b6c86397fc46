"""Asking whether a recovery may help: IsStuck, WouldAPlannerRecoveryHelp, WouldAControllerRecoveryHelp, …"""

from __future__ import annotations

from typing import ClassVar

from behaviours.skill import SkillCondition
from bestman_bt.engine import In, InOut


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


class IsStuck(SkillCondition):
    """True from when a commanded base has stalled, or was stopped harder than it brakes, until it moves again."""

    REQUIRES = ("base", "lidar")
    FAILS: ClassVar = {"not_stuck": "nothing is wrong"}

    def check(self) -> tuple[str, str] | None:
        """Asks the base's controller."""
        if self.skills.base.stuck:
            return None
        return "not_stuck", "the base moves as it is told"
