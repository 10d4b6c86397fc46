"""Conditions on the believed state of doors and drawers."""

from __future__ import annotations

from typing import ClassVar

from behaviours.furniture.articulation import UNKNOWN_ARTICULATION, find_articulation
from behaviours.skill import ArticulationName, InstantSkill, SkillCondition
from bestman_bt.engine import In, Out
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.openness import openness_of


class _OfContainer(InstantSkill):
    container = In[str](ArticulationName, "a door or drawer of the map, such as drawer_chest/drawer_3")
    FAILS: ClassVar = UNKNOWN_ARTICULATION


class TakeContainer(_OfContainer):
    """Output the furniture of a door or drawer, and its thresholds for open and shut."""

    furniture = Out(str, "the furniture that it belongs to")
    opening = Out(float, "target opening for working behind it, metres or radians")
    shut = Out(float, "largest opening that counts as shut, metres or radians")

    def act(self) -> None:
        """Read the map."""
        door = find_articulation(self.skills, self.container)
        openness = openness_of(door.articulation)
        self.furniture = door.furniture.name
        self.opening = openness.asked
        self.shut = openness.shut


class BelieveLocked(_OfContainer):
    """Remember that a door or drawer did not open, so that no plan relies on opening it."""

    def act(self) -> None:
        """Set the belief; no motion."""
        self.skills.world.locked.add(find_articulation(self.skills, self.container).name)


class BelieveStuck(_OfContainer):
    """Remember that a door or drawer could not be opened for now, so that other ways are tried first.

    Any motion of a door or drawer clears it, as does ``ForgetBlocked``.
    """

    def act(self) -> None:
        """Set the belief; no motion."""
        self.skills.world.blocked.add(find_articulation(self.skills, self.container).name)


class IsOpen(SkillCondition):
    """Check whether the believed opening of a door or drawer is at least, or at most, a given value."""

    articulation = In[str](ArticulationName, "furniture/name of the map")
    at_least = In[float](NonNegative, "metres or radians", default=0.0)
    at_most = In[float | None](NonNegative, "metres or radians; any without it", required=False)
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "not_open": "Open",
        "not_closed": "Close",
    }

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
        name: str = self.articulation
        at_least, at_most = self.at_least, self.at_most
        door = find_articulation(self.skills, name).articulation
        position = self.skills.world.articulations.get(name, 0.0)
        unit = "rad" if door.kind == "revolute" else "m"
        if not position >= at_least:  # nor if the belief is not a number
            return "not_open", f"{name} is open by {position:.2f} {unit} only"
        if at_most is not None and not position <= at_most:
            return "not_closed", f"{name} is open by {position:.2f} {unit}"
        return None
