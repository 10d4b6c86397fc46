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
    """Forget which surfaces could not be reached, to try them once more."""

    forgotten = Out(int, "how many there were")

    def act(self) -> None:
        """Writes a belief; moves nothing."""
        blocked = self.skills.world.blocked
        self.forgotten = len(blocked)
        self.feedback_message = ", ".join(sorted(blocked))
        blocked.clear()
