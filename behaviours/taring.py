"""Waiting until the wrist has learned what it reads while nothing touches the hand."""

from __future__ import annotations

from behaviours.skill import Skill, Steps
from behaviours.waiting import Until


def tare_wrist(skill: Skill) -> Steps:
    """Learn the wrist's offset, with the hand at rest and touching nothing; nothing to do without such a sensor.

    It is over when the readings are gathered; where the hand was not still, the older offset serves.
    """
    wrist = skill.skills.wrist_wrench
    if wrist is not None:
        wrist.tare()
        yield Until(lambda: not wrist.taring)
