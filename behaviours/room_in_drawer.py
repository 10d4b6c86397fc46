"""Where in an open drawer there is room, as far as is believed: the hand is full, so that its camera cannot look."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.names import ObjectName, SurfaceName
from behaviours.skill import InstantSkill, SkillFailure
from behaviours.surfaces import UNKNOWN_SURFACE, find_surface
from bestman_bt.engine import In, Out
from bestman_bt.messages import ObjectModel, Pose

STEP = 0.02
"""Metres between the places that are considered."""
ENOUGH = 0.05
"""Metres of room beyond which more of it makes a place no better."""
SAME_PLACE = 0.06
"""Metres: a place nearer than this to one that was given is the same one."""


class FindRoomIn(InstantSkill):
    """Choose a place for the held object in a drawer that stands open, away from what is believed to be in it.

    Of the places with enough room in the part that has come out, the one nearest to the middle of that part; asked
    again for the same object it gives another one.
    """

    object = In[str](ObjectName, "the held object")
    surface = In[str](SurfaceName, "the surface of the drawer, such as drawer_chest/drawer_3")
    margin = In(float, "metres to the drawer's walls and to other things", default=0.03)
    pose = Out(Pose, "where it shall stand, in the map frame", required=True)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "not_holding": "take it: DetectObject, PlanGrasp, Grasp",
        "surface_full": "another drawer",
    }

    def on_load(self) -> None:
        """Nothing has been given yet."""
        self._object = ""
        self._given = np.zeros((0, 2))

    def act(self) -> None:
        """Asks the beliefs; takes no picture."""
        world = self.skills.world
        name: str = self.object
        held = next((one for one in world.hands.values() if one.name == name), None)
        if held is None:
            raise SkillFailure("not_holding", f"the hand does not hold the {name}")
        furniture, surface = find_surface(self.skills, self.surface)
        map_from_surface = furniture.pose.to_pose() @ surface.pose
        full = f"{furniture.name}/{surface.name}"
        inside = [belief for belief in world.objects.values() if belief.surface == full]
        others = [(map_from_surface.inverse() @ belief.pose).position[:2] for belief in inside]
        radii = [_radius(belief.model) for belief in inside]
        places = self._grid(surface.size, float(surface.pose.position[0]) + furniture.footprint[0] / 2)
        room = self._room(places, surface.size, np.reshape(others, (-1, 2)), np.array(radii)) - _radius(held.model)
        places, room = places[room >= self.margin], room[room >= self.margin]
        if not len(places):
            raise SkillFailure("surface_full", f"no room for the {name} is believed to be left in the {full}")
        best = self._choose(name, places, room)
        height = -float(held.model.bounds()[0, 2])
        self.pose = map_from_surface @ Pose(np.array([*best, height]))

    def _choose(self, name: str, places: NDArray[np.float64], room: NDArray[np.float64]) -> NDArray[np.float64]:
        """One of the places (N, 2) that was not given before, as far as there is one."""
        if name != self._object:
            self._object, self._given = name, np.zeros((0, 2))
        near_given = (np.linalg.norm(places[:, None] - self._given[None], axis=2) < SAME_PLACE).any(axis=1)
        if near_given.all():
            self._given = np.zeros((0, 2))
            near_given[:] = False
        middle = (places.min(axis=0) + places.max(axis=0)) / 2
        order = np.lexsort((np.linalg.norm(places - middle, axis=1), -np.minimum(room, ENOUGH), near_given))
        best: NDArray[np.float64] = places[order[0]]
        self._given = np.vstack([self._given, best])
        return best

    def _grid(self, size: tuple[float, float], behind_front: float) -> NDArray[np.float64]:
        """Places (N, 2) in its frame, metres; ``behind_front``: how far its middle is within the furniture."""
        x = np.arange(-size[0] / 2, min(size[0] / 2, -behind_front) + 1e-9, STEP)
        y = np.arange(-size[1] / 2, size[1] / 2 + 1e-9, STEP)
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)

    def _room(
        self,
        places: NDArray[np.float64],
        size: tuple[float, float],
        others: NDArray[np.float64],
        radii: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Metres from each place (N, 2) to the next wall or thing, (N,)."""
        walls = (np.array(size) / 2 - np.abs(places)).min(axis=1)
        away = np.linalg.norm(places[:, None] - others[None], axis=2) - radii[None]
        room: NDArray[np.float64] = np.minimum(walls, away.min(axis=1, initial=np.inf))
        return room


def _radius(model: ObjectModel) -> float:
    return float(np.linalg.norm(model.size[:2])) / 2
