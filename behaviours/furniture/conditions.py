"""What is believed of doors and drawers, as conditions."""

from __future__ import annotations

from typing import ClassVar

from behaviours.furniture.leaf import UNKNOWN_ARTICULATION, find_leaf
from behaviours.skill import ArticulationName, InstantSkill, SkillCondition
from bestman_bt.engine import In, Out
from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.openness import openness_of

# Doors and drawers as abilities name them: how far to open one, and that one did not open.


_CONTAINER = BoundedPort(ArticulationName, description="a door or drawer of the map, such as drawer_chest/drawer_3")


class TakeContainer(InstantSkill):
    """Tell of a door or drawer on which furniture it is, and what open and shut mean for it."""

    INPUT_PORTS: ClassVar = {"container": _CONTAINER}
    furniture = Out(str, "the piece that it belongs to")
    opening = Out(float, "how far it is opened to work behind it, metres or radians")
    shut = Out(float, "up to where it counts as shut, metres or radians")
    FAILS: ClassVar = UNKNOWN_ARTICULATION

    def act(self) -> None:
        """Asks the map."""
        leaf = find_leaf(self.skills, self.get_input("container"))
        openness = openness_of(leaf.leaf)
        self.furniture = leaf.furniture.name
        self.opening = openness.asked
        self.shut = openness.shut


class BelieveLocked(InstantSkill):
    """Remember that a door or drawer did not open, so that nothing is planned that needs it open."""

    INPUT_PORTS: ClassVar = {"container": _CONTAINER}
    FAILS: ClassVar = UNKNOWN_ARTICULATION

    def act(self) -> None:
        """Writes a belief; moves nothing."""
        name: str = find_leaf(self.skills, self.get_input("container")).articulation
        self.skills.world.locked.add(name)


class BelieveStuck(InstantSkill):
    """Remember that a door or drawer could not be opened for now, so that something else is tried first.

    What moves a door or drawer clears it, and ``ForgetBlocked``.
    """

    INPUT_PORTS: ClassVar = {"container": _CONTAINER}
    FAILS: ClassVar = UNKNOWN_ARTICULATION

    def act(self) -> None:
        """Writes a belief; moves nothing."""
        self.skills.world.blocked.add(find_leaf(self.skills, self.get_input("container")).articulation)


class IsOpen(SkillCondition):
    """Whether a door or drawer is believed to be open by at least, or by at most, so much."""

    articulation = In[str](ArticulationName, "furniture/leaf of the map")
    at_least = In[float](NonNegative, "metres or radians", default=0.0)
    at_most = In[float | None](NonNegative, "metres or radians; any without it", required=False)
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
        if at_most is not None and not position <= at_most:
            return "not_closed", f"{name} is open by {position:.2f} {unit}"
        return None
