"""Placing into an open drawer: the current goal, and lowering the object over the rim."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.manipulation.place import PlaceOn
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface
from behaviours.skill import Declaration, ErrorReporting, InstantSkill, ObjectName, SkillFailure, SurfaceName
from bestman_bt.engine import In, Out, SyncAction
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.openness import articulation_shapes
from bestman_bt.world_model.semantic_map import MapFurniture, MapSurface
from bestman_bt.world_model.world_model import HeldObject

STEP = 0.02
"""Distance between candidate places, metres."""
ENOUGH = 0.05
"""Free space above which more does not improve a place, metres."""
SAME_PLACE = 0.06
"""Distance below which two positions count as the same, metres."""


class FindRoomIn(InstantSkill):
    """Choose a place for the held object in an open drawer, away from objects believed to be in it.

    It is the place nearest to the middle of the opened part that has enough room; each further call for the same object
    gives another one.
    """

    object = In[str](ObjectName, "the held object")
    surface = In[str](SurfaceName, "the surface of the drawer, such as drawer_chest/drawer_3")
    margin = In[float](NonNegative, "metres to the drawer's walls and to other things", default=0.03)
    pose = Out(Pose, "target pose of the object, in the map frame", required=True)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "not_holding": "take it: DetectObject, PlanGrasp, Grasp",
        "surface_full": "another drawer",
    }

    def on_load(self) -> None:
        """Reset the given places."""
        self._object = ""
        self._given = np.zeros((0, 2))

    def act(self) -> None:
        """Choose a place by the believed objects; take no image. Raises SkillFailure if none is free."""
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
        """Choose one of the places (N, 2), preferably one that was not returned before."""
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
        """Return places (N, 2) in its frame, metres; ``behind_front``: depth of its middle within the furniture."""
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
        """Return the distance (N,), metres, from each place (N, 2) to the next wall or object."""
        walls = (np.array(size) / 2 - np.abs(places)).min(axis=1)
        away = np.linalg.norm(places[:, None] - others[None], axis=2) - radii[None]
        room: NDArray[np.float64] = np.minimum(walls, away.min(axis=1, initial=np.inf))
        return room


def _radius(model: ObjectModel) -> float:
    return float(np.linalg.norm(model.size[:2])) / 2


class GoalOnSurface(ErrorReporting, SyncAction):
    """Output the current pose of a goal; a goal in a drawer is given for the closed drawer and moves with it."""

    goal = In(Pose, "in the map frame, for the closed drawer")
    surface = In[str](SurfaceName, "the surface, such as drawer_chest/drawer_3")
    now = Out(Pose, "in the map frame, as far as it is open", required=True)
    FAILS: ClassVar = UNKNOWN_SURFACE

    def on_tick(self) -> int:
        """Read the belief."""
        goal: Pose = self.goal
        try:
            furniture, surface = find_surface(self.skills, self.surface)
        except SkillFailure as failure:
            return self.explain_error(failure)
        if surface.drawer is not None:
            opened = self.skills.world.opening_of(furniture, furniture.articulation(surface.drawer))
            frame = furniture.pose.to_pose()
            goal = frame @ opened @ frame.inverse() @ goal
        self.now = goal
        return self.succeed()


class PlaceIn(PlaceOn):
    """Move the held object over the rim of an open drawer and lower it straight until just above the bottom."""

    object = In[str](ObjectName, "the held object")
    pose = In(Pose, "target pose of the object in the drawer, in the map frame")
    FAILS: ClassVar = {"no_drawer": "make sure that it is open: IsOpen, Open; update the goal: GoalOnSurface"}
    DECLARATION = Declaration(pre=("holding({object})", "free({pose})"), effects=("lowered({object}, {pose})",))

    def _above(self, held: HeldObject) -> float:
        """Return the height at which no part of the object is below the rim."""
        pose: Pose = self.pose
        furniture, surface = self._drawer(pose)
        assert surface.drawer is not None
        shapes = articulation_shapes(self.skills.world, furniture, furniture.articulation(surface.drawer))
        rim = max(_top(placed) for placed in shapes)
        return rim + self.skills.parameters.place.rim_clearance - float(pose.position[2] + held.model.bounds()[0, 2])

    def _drawer(self, pose: Pose) -> tuple[MapFurniture, MapSurface]:
        """Return the drawer in whose rectangle the pose lies, the one next below it."""
        world = self.skills.world
        below: list[tuple[float, MapFurniture, MapSurface]] = []
        for piece in world.map.furniture.values():
            for drawer in (mapped for mapped in piece.surfaces if mapped.drawer is not None):
                _, surface = world.surface(f"{piece.name}/{drawer.name}")
                x, y, z = ((piece.pose.to_pose() @ surface.pose).inverse() @ pose).position
                if abs(x) <= surface.size[0] / 2 and abs(y) <= surface.size[1] / 2 and z > 0.0:
                    below.append((float(z), piece, surface))
        if not below:
            x, y, z = pose.position
            raise SkillFailure("no_drawer", f"no drawer is believed to be below x {x:.2f} y {y:.2f} z {z:.2f} m")
        _, furniture, surface = min(below, key=lambda entry: entry[0])
        return furniture, surface


def _top(placed: PlacedShape) -> float:
    """Return the z of the highest point of a board, metres."""
    assert isinstance(placed.shape, Box)
    return float(placed.pose.position[2] + np.abs(placed.pose.rotation[2]) @ np.array(placed.shape.size) / 2)
