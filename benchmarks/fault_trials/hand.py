"""A leaf that moves the fingers alone: shipped skills move them as part of a grasp."""

from __future__ import annotations

from typing import ClassVar

from py_trees.ports import PortInformation

from behaviours.skill import Skill, SkillCoroutine

SPEED = 0.05
"""Metres per second of the width."""


class MoveFingers(Skill):
    """Open or close the hand to a width, slowly."""

    INPUT_PORTS: ClassVar = {"width": PortInformation(float, description="metres between the fingers")}

    def execute(self) -> SkillCoroutine[None]:
        """Move and wait."""
        yield self.skills.gripper.open(self.get_input("width"), SPEED)
