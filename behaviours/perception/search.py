"""Searching: whether an object was found, or its possible places were all seen."""

from __future__ import annotations

from typing import ClassVar

from behaviours.context import SkillContext
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface
from behaviours.skill import ObjectName, SkillCondition, SurfaceName
from bestman_bt.engine import In

HIDDEN_AT_MOST = 0.02
"""Hidden fraction of a surface up to which it counts as completely seen: corners behind known objects."""
THING = 0.06
"""Assumed width of an object without a model, metres."""


class FoundOrSeenAll(SkillCondition):
    """Check whether the place of an object is known, or no hidden part of a surface is left that may contain it.

    It uses the space mapped by ``ScanScene``, including what the robot's own arm has hidden.
    """

    object = In[str](ObjectName, "the object to search for")
    surface = In[str](SurfaceName, "the surface that was scanned, such as table")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "part_hidden": "another posture, MoveArm, or stand, FindStandPose and NavigateTo; then ScanScene",
    }

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
        if self.object in self.skills.world.objects:
            return None
        hidden = hidden_part(self.skills, self.object, self.surface)
        if hidden <= HIDDEN_AT_MOST:
            return None
        return "part_hidden", f"{hidden:.0%} of the {self.surface} was hidden, the {self.object} may be there"


def hidden_part(skills: SkillContext, name: str, surface_name: str) -> float:
    """Return the fraction of a surface, 0 to 1, in which the last scan could not have detected an object.

    It is 0 without a scan, and for drawers, into which the wrist camera looks from above.
    """
    from bestman_bt.perception.occupancy import hidden_share

    furniture, surface = find_surface(skills, surface_name)
    grid, model = skills.world.occupancy, skills.world.models.get(name)
    if grid is None or surface.drawer is not None:
        return 0.0
    width = THING if model is None else float(model.size[:2].min())
    return hidden_share(grid, furniture.pose.to_pose() @ surface.pose, surface.size, width)


class FoundOn(SkillCondition):
    """Check whether an object is believed to be on a surface that was just looked at; remember failed searches.

    If it was found on another surface on the way, the check fails, and its place is known. If a part of the surface was
    always hidden, ``ForgetBlocked`` allows another search there.
    """

    object = In[str](ObjectName, "the object to search for")
    surface = In[str](SurfaceName, "the surface that was looked at, such as table")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "not_found": "search elsewhere: Plan, or another place",
    }

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
        world = self.skills.world
        name: str = self.object
        furniture, surface = find_surface(self.skills, self.surface)
        place = f"{furniture.name}/{surface.name}"
        belief = world.objects.get(name)
        if belief is None:
            world.searched[name, place] = self.skills.clock.now()
            world.searched_in_part.discard((name, place))
            hidden = hidden_part(self.skills, name, place)
            if hidden <= HIDDEN_AT_MOST:
                return "not_found", f"the {name} was not seen on the {place}"
            world.searched_in_part.add((name, place))
            return "not_found", f"the {name} was not seen on the {place}, {hidden:.0%} of which was hidden"
        if belief.surface is not None:
            seen_furniture, seen_surface = find_surface(self.skills, belief.surface)
            if seen_furniture.name == furniture.name and seen_surface.name == surface.name:
                return None
        return "not_found", f"the {name} was seen on the {belief.surface}, not on the {place}"
