"""What is believed of doors and drawers, as conditions."""

from __future__ import annotations

import math
from typing import ClassVar

from behaviours.leaf import UNKNOWN_ARTICULATION, find_leaf
from behaviours.names import ArticulationName
from behaviours.skill import SkillCondition
from bestman_bt.engine import In


class IsOpen(SkillCondition):
    """Whether a door or drawer is believed to be open by at least, or by at most, so much."""

    articulation = In[str](ArticulationName, "furniture/leaf of the map")
    at_least = In(float, "metres or radians", default=0.0)
    at_most = In(float, "metres or radians", default=math.inf)
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "not_open": "Open",
        "not_closed": "Close",
    }

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        name: str = self.articulation
        at_least, at_most = self.at_least, self.at_most
        leaf = find_leaf(self.skills, name).leaf
        position = self.skills.world.articulations.get(name, 0.0)
        unit = "rad" if leaf.kind == "revolute" else "m"
        if not position >= at_least:  # nor where the belief is no number
            return "not_open", f"{name} is open by {position:.2f} {unit} only"
        if not position <= at_most:
            return "not_closed", f"{name} is open by {position:.2f} {unit}"
        return None
