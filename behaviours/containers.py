"""Doors and drawers as abilities name them: how far to open one, and that one did not open."""

from __future__ import annotations

from typing import ClassVar

from behaviours.leaf import UNKNOWN_ARTICULATION, find_leaf
from behaviours.names import ArticulationName
from behaviours.skill import InstantSkill
from bestman_bt.engine import Out
from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.world_model import openness_of

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
