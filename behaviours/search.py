"""Searching: was what was looked for seen? And if not, that it was looked for there."""

from __future__ import annotations

from typing import ClassVar

from behaviours.names import ObjectName, SurfaceName
from behaviours.skill import SkillCondition
from behaviours.surfaces import UNKNOWN_SURFACE, find_surface
from bestman_bt.engine import In


class FoundOn(SkillCondition):
    """Whether an object is believed to be on a surface that was just looked at; remembers where it was not found.

    Found on another surface on the way it counts as not found here, and its place is known.
    """

    object = In[str](ObjectName, "the object that is looked for")
    surface = In[str](SurfaceName, "the surface that was looked at, such as table")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "not_found": "look elsewhere: Plan, or another place",
    }

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        world = self.skills.world
        name: str = self.object
        furniture, surface = find_surface(self.skills, self.surface)
        place = f"{furniture.name}/{surface.name}"
        belief = world.objects.get(name)
        if belief is None:
            world.searched[name, place] = self.skills.clock.now()
            return "not_found", f"the {name} was not seen on the {place}"
        if belief.surface is not None:
            seen_furniture, seen_surface = find_surface(self.skills, belief.surface)
            if seen_furniture.name == furniture.name and seen_surface.name == surface.name:
                return None
        return "not_found", f"the {name} was seen on the {belief.surface}, not on the {place}"
