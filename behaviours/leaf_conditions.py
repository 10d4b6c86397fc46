"""What is believed of doors and drawers, as conditions."""

from __future__ import annotations

import math
from typing import ClassVar

from py_trees.ports import PortInformation

from behaviours.leaf import UNKNOWN_ARTICULATION, find_leaf
from behaviours.names import ArticulationName
from behaviours.skill import SkillCondition
from bestman_bt.engine.bounds import BoundedPort


class IsOpen(SkillCondition):
    """Whether a door or drawer is believed to be open by at least, or by at most, so much."""

    INPUT_PORTS: ClassVar = {
        "articulation": BoundedPort(ArticulationName, description="furniture/leaf of the map"),
        "at_least": PortInformation(float, required=False, default_value=0.0, description="metres or radians"),
        "at_most": PortInformation(float, required=False, default_value=math.inf, description="metres or radians"),
    }
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "not_open": "Open",
        "not_closed": "Close",
    }

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        name: str = self.get_input("articulation")
        at_least, at_most = self.get_input("at_least"), self.get_input("at_most")
        leaf = find_leaf(self.skills, name).leaf
        position = self.skills.world.articulations.get(name, 0.0)
        unit = "rad" if leaf.kind == "revolute" else "m"
        if not position >= at_least:  # nor where the belief is no number
            return "not_open", f"{name} is open by {position:.2f} {unit} only"
        if not position <= at_most:
            return "not_closed", f"{name} is open by {position:.2f} {unit}"
        return None
