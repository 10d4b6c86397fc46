"""Placing into a drawer that stands open: where the goal is now, and lowering the object over the rim."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from behaviours.names import ObjectName, SurfaceName
from behaviours.place import PlaceOn
from behaviours.skill import Declaration, Explained, SkillFailure
from behaviours.surfaces import UNKNOWN_SURFACE, find_surface
from bestman_bt.engine import In, Out, SyncAction
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.world_model import HeldObject, MapFurniture, MapSurface, leaf_shapes

OVER_THE_RIM = 0.03
"""Metres between the rim and the lowest point of the object where its straight descent begins."""


class GoalOnSurface(Explained, SyncAction):
    """Tell where a goal is now: in a drawer it is given for the closed one, and goes with it."""

    goal = In(Pose, "in the map frame, for the closed drawer")
    surface = In[str](SurfaceName, "the surface, such as drawer_chest/drawer_3")
    now = Out(Pose, "in the map frame, as far as it is open", required=True)
    FAILS: ClassVar = UNKNOWN_SURFACE

    def on_tick(self) -> int:
        """Asks the beliefs."""
        goal: Pose = self.goal
        try:
            furniture, surface = find_surface(self.skills, self.surface)
        except SkillFailure as failure:
            return self.explain_error(failure)
        if surface.leaf is not None:
            opened = self.skills.world.opening_of(furniture, furniture.leaf(surface.leaf))
            frame = furniture.pose.to_pose()
            goal = frame @ opened @ frame.inverse() @ goal
        self.now = goal
        return self.succeed()


class PlaceIn(PlaceOn):
    """Bring the held object over the rim of an open drawer and lower it straight until it all but stands there."""

    object = In[str](ObjectName, "the held object")
    pose = In(Pose, "where it shall stand in the drawer, in the map frame")
    FAILS: ClassVar = {"no_drawer": "see that it stands open: IsOpen, Open; ask where the goal is now: GoalOnSurface"}
    DECLARATION = Declaration(pre=("holding({object})", "free({pose})"), effects=("lowered({object}, {pose})",))

    def _above(self, held: HeldObject) -> float:
        """So high that nothing of the object is below the rim."""
        pose: Pose = self.pose
        furniture, surface = self._drawer(pose)
        assert surface.leaf is not None
        shapes = leaf_shapes(self.skills.world, furniture, furniture.leaf(surface.leaf))
        rim = max(_top(placed) for placed in shapes)
        return rim + OVER_THE_RIM - float(pose.position[2] + held.model.bounds()[0, 2])

    def _drawer(self, pose: Pose) -> tuple[MapFurniture, MapSurface]:
        """The drawer in whose rectangle the pose lies, the one next below it."""
        world = self.skills.world
        below: list[tuple[float, MapFurniture, MapSurface]] = []
        for piece in world.map.furniture.values():
            for drawer in (mapped for mapped in piece.surfaces if mapped.leaf is not None):
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
    """z of the highest point of a board, metres."""
    assert isinstance(placed.shape, Box)
    return float(placed.pose.position[2] + np.abs(placed.pose.rotation[2]) @ np.array(placed.shape.size) / 2)
