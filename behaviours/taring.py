"""Waiting until the wrist has learned what it reads while nothing touches the hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from behaviours.skill import Skill, Steps

if TYPE_CHECKING:
    from bestman_bt.control.force_torque import WristWrench


class _Taring:
    """Over when the readings are gathered; where the hand was not still, the older offset serves."""

    def __init__(self, wrist: WristWrench) -> None:
        self._wrist = wrist

    @property
    def done(self) -> bool:
        return not self._wrist.taring

    def cancel(self) -> None:
        """It ends by itself."""


def tare_wrist(skill: Skill) -> Steps:
    """Learn the wrist's offset, with the hand at rest and touching nothing; nothing to do without such a sensor."""
    wrist = skill.skills.wrist_wrench
    if wrist is not None:
        wrist.tare()
        yield _Taring(wrist)
