"""Asking whether a recovery may help: IsStuck, WouldAPlannerRecoveryHelp, WouldAControllerRecoveryHelp, …"""

from __future__ import annotations

from typing import ClassVar

from py_trees.ports import PortInformation

from behaviours.skill import SkillCondition


class AreErrorCodesPresent(SkillCondition):
    """Whether an ``error_code`` is one of ``error_codes_to_check``."""

    INPUT_PORTS: ClassVar = {
        "error_code": PortInformation(str, required=False, default_value="", description="of the leaf that failed"),
        "error_codes_to_check": PortInformation(list[str], required=False, description="code;code"),
    }
    CODES: ClassVar[tuple[str, ...]] = ()
    """What is looked for where the port names none."""

    FAILS: ClassVar = {"other_code": "the failure is of another kind; nothing is wrong"}

    def check(self) -> tuple[str, str] | None:
        """Compares."""
        code = self.get_input("error_code")
        if code in (self.get_input("error_codes_to_check") or self.CODES):
            return None
        return "other_code", f"{code!r} is none of them" if code else "there is no error code"


class WouldAPlannerRecoveryHelp(AreErrorCodesPresent):
    """Whether planning failed for a reason that may go away: something is in the way, and not the goal off the map."""

    CODES: ClassVar = ("no_path", "start_blocked", "goal_blocked", "arm_in_the_way")


class WouldAControllerRecoveryHelp(AreErrorCodesPresent):
    """Whether driving failed for a reason that may go away."""

    CODES: ClassVar = ("blocked", "tolerance", "no_path", "path_blocked")


class IsStuck(SkillCondition):
    """Whether the base was to move and does not get on, or was stopped harder than it brakes; until it moves again."""

    REQUIRES = ("base", "lidar")
    FAILS: ClassVar = {"not_stuck": "nothing is wrong"}

    def check(self) -> tuple[str, str] | None:
        """Asks the base's controller."""
        if self.skills.base.stuck:
            return None
        return "not_stuck", "the base moves as it is told"
