"""Base placements for doors and drawers: to see a handle, to pull it open and to push the front shut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar

from behaviours.context import DRIVEN
from behaviours.furniture.articulation import (
    UNKNOWN_ARTICULATION,
    ArticulationPath,
    FurnitureArticulation,
    find_articulation,
    find_stands,
    room_beside,
)
from behaviours.furniture.close import FrontPush, pushes
from behaviours.furniture.opening import Opening, before, plan_opening, pull_grasps, stations
from behaviours.manipulation.base_placement import FindBasePlacement
from behaviours.skill import ArticulationName, Declaration, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.world_model import MOVED, HandleBelief

if TYPE_CHECKING:
    from bestman_bt.manipulation.base_placement import PathPlacement


CLOSE_DISTANCES = (0.55, 0.65, 0.75, 0.85, 0.95)
"""Metres from the middle of the pushed point's path to the middle of the base."""
CLOSE_BEARINGS = tuple(math.radians(degrees) for degrees in range(-90, 91, 15))
TURNS = (0.0, -0.5, 0.5)


class _FindStandAtArticulation(FindBasePlacement):
    """Base class of skills that place the base for the arm to move a door or drawer."""

    articulation = In[str](ArticulationName, "furniture/name of the map")

    def _along(
        self, door: FurnitureArticulation, ways: Iterator[ArticulationPath], work: str
    ) -> SkillCoroutine[Sequence[PathPlacement]]:
        """Return placements from which the arm follows one of ``ways``; ``work``: what for, for the failure."""
        stands: Sequence[PathPlacement] = yield self.compute("stand_planning", find_stands, self.skills, door, ways)
        if not stands:
            raise SkillFailure("no_stand", f"no free base placement lets the arm {work}")
        return stands


class FindCloseStand(_FindStandAtArticulation):
    """Choose a base placement from which the arm can push a door or drawer shut from its believed opening.

    Each further call gives another placement, until none is left.
    """

    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "no_stand": "look where it stands now: FindLookStand, DetectHandle",
    }
    DECLARATION = Declaration(effects=("stand_known({articulation})",))

    def _ranked(self) -> SkillCoroutine[Sequence[PathPlacement]]:
        """Search the ways to push in turn for base placements."""
        door = find_articulation(self.skills, self.articulation)
        return self._along(door, self._ways(door), f"push {door.name} shut")

    def _ways(self, door: FurnitureArticulation) -> Iterator[ArticulationPath]:
        skills = self.skills
        is_base_free = None
        around: dict[tuple[float, ...], list[Pose2D]] = {}
        for push in pushes(skills, door):
            positions, point = push.positions(), tuple(push.point)
            is_base_free = is_base_free or room_beside(skills, door, positions)
            if point not in around:  # however the hand is held there
                around[point] = [stand for stand in _around(push) if self._is_new(stand) and is_base_free(stand)]
            before = push.stations(push.parameters.standoff)[0]
            yield ArticulationPath(around[point], [before, *push.stations()], positions, "fingers", skip=1)


def _around(push: FrontPush) -> tuple[Pose2D, ...]:
    from bestman_bt.manipulation.base_placement import placements_around

    middle = push.start / 2
    outward = -push.door.front(middle).rotation[:, 0]
    front = math.atan2(outward[1], outward[0])
    return placements_around(
        push.at(middle)[:2], CLOSE_DISTANCES, [front + bearing for bearing in CLOSE_BEARINGS], TURNS
    )


LOOK_DISTANCES = (0.90, 1.05, 0.75, 1.20)
"""Metres from a front to the middle of the base that looks at it."""
LOOK_BEARINGS = tuple(math.radians(degrees) for degrees in (0, 50, -50))
"""Directions to look from, relative to straight ahead: a door that is open without the robot knowing may be edge-on."""
DISTANCES = (0.55, 0.65, 0.75, 0.85, 0.95, 1.05)
"""Metres from a handle to the middle of the base that pulls it."""
BEARINGS = tuple(math.radians(degrees) for degrees in range(-75, 76, 15))


class FindLookStand(Skill):
    """Choose a base pose that sees the front of a mapped door or drawer, and a point to look at."""

    REQUIRES = ("base", "lidar")
    articulation = In[str](ArticulationName, "furniture/name of the map")
    stand = Out(Pose2D, "where to stand, in the map frame", required=True)
    front = Out(Pose, "the middle of its front as it is believed, in the map frame", required=True)
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "no_stand": "the obstacle may have gone: ForgetBlocked, then retry",
    }
    DECLARATION = Declaration(effects=("stand_known({articulation})",))

    def on_load(self) -> None:
        """Reset the tried placements."""
        self._asked, self._position = 0, math.nan

    def execute(self) -> SkillCoroutine[None]:
        """Return a base pose with free space; each further call starts at the next bearing.

        If the believed opening has changed, it starts straight in front again.
        """
        from bestman_bt.manipulation.base_placement import placements_around

        articulation: str = self.articulation
        door = find_articulation(self.skills, articulation)
        position = self.skills.world.articulations.get(articulation, 0.0)
        if not abs(position - self._position) <= MOVED:
            self._asked, self._position = 0, position
        front = door.front(position)
        facing = math.atan2(-float(front.rotation[1, 0]), -float(front.rotation[0, 0]))
        clearance = yield self.compute("stand_planning", lambda: self.skills.known_costmap(DRIVEN).clearance_at)
        first = self._asked % len(LOOK_BEARINGS)
        self._asked += 1
        for bearing in (*LOOK_BEARINGS[first:], *LOOK_BEARINGS[:first]):
            stands = placements_around(front.position[:2], LOOK_DISTANCES, (facing + bearing,), (0.0,))
            stand = next((stand for stand in stands if clearance(stand) > 0.0), None)
            if stand is not None:
                self.stand = stand
                self.front = front
                return
        raise SkillFailure("no_stand", f"no room to stand in front of {articulation}")


class FindOpenStand(_FindStandAtArticulation):
    """Choose a base placement from which the arm can grasp a handle and follow it over the requested opening.

    The arm stays on one branch of inverse kinematics. Each further call gives another placement, until none is left.
    """

    handle = In(str, "a believed handle")
    opening = In[float](NonNegative, "how far to open: metres of a drawer, radians of a door")
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "handle_not_found": "DetectHandle first",
        "no_stand": "ask for less opening, or open another door or drawer",
    }
    DECLARATION = Declaration(pre=("handle_known({handle})",), effects=("stand_known({articulation})",))

    def _ranked(self) -> SkillCoroutine[Sequence[PathPlacement]]:
        """Rank base placements around the handle by how well the arm follows the whole path, for all grasps."""
        belief = self.skills.world.handles.get(self.handle)
        if belief is None:
            raise SkillFailure("handle_not_found", f"the handle {self.handle} has not been seen; detect it first")
        opening = plan_opening(self.skills, self.articulation, belief, self.opening)
        return self._along(opening.door, self._ways(opening, belief), f"open {self.articulation} as far as asked")

    def _ways(self, opening: Opening, belief: HandleBelief) -> Iterator[ArticulationPath]:
        from bestman_bt.manipulation.base_placement import placements_around

        skills = self.skills
        position, outward = opening.handle.pose.position, opening.handle.outward
        front = math.atan2(outward[1], outward[0])
        is_base_free = room_beside(skills, opening.door, opening.positions())
        stands = [
            stand
            for stand in placements_around(position[:2], DISTANCES, [front + bearing for bearing in BEARINGS], TURNS)
            if self._is_new(stand) and is_base_free(stand)
        ]
        for candidate in pull_grasps(skills, opening, belief):
            grasp, pre_grasp = skills.map_from_base @ candidate.grasp, skills.map_from_base @ candidate.pre_grasp
            tilts = opening.tilts(grasp)
            way = [before(opening, grasp, pre_grasp, tilts), *stations(opening, grasp, tilts)]
            yield ArticulationPath(stands, way, opening.positions(), opening.touching, skip=1)
