"""Places that could be reached from nowhere: remembered, so that plans go round them, and forgotten again."""

from __future__ import annotations

from typing import ClassVar

from behaviours.names import SurfaceName
from behaviours.skill import InstantSkill
from behaviours.surfaces import UNKNOWN_SURFACE, find_surface
from bestman_bt.engine import In, Out


class BelieveBlocked(InstantSkill):
    """Remember that there was nowhere to stand from where a surface could be reached."""

    surface = In[str](SurfaceName, "the surface, such as table")
    FAILS: ClassVar = UNKNOWN_SURFACE

    def act(self) -> None:
        """Writes a belief; moves nothing. What moves a door or drawer clears it."""
        furniture, surface = find_surface(self.skills, self.surface)
        self.skills.world.blocked.add(f"{furniture.name}/{surface.name}")


class ForgetBlocked(InstantSkill):
    """Forget which surfaces could not be reached, or seen but in part, to try them once more."""

    forgotten = Out(int, "how many there were")

    def act(self) -> None:
        """Writes a belief; moves nothing."""
        world = self.skills.world
        in_part = {place for _, place in world.searched_in_part}
        self.forgotten = len(world.blocked) + len(world.searched_in_part)
        self.feedback_message = ", ".join(sorted(world.blocked | in_part))
        world.blocked.clear()
        for searched in world.searched_in_part:
            world.searched.pop(searched, None)
        world.searched_in_part.clear()
