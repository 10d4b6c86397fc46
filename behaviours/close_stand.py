"""Standing to close a door or drawer: from where the arm pushes its front all the way shut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.closing import BEFORE, Push, pushes
from behaviours.leaf import UNKNOWN_ARTICULATION, Leaf, find_leaf
from behaviours.leaf_stand import SAME_STAND, LeafWay, find_stands, room_beside
from behaviours.names import ArticulationName
from behaviours.skill import Declaration, OnArm, Skill, SkillFailure, Steps
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose2D

if TYPE_CHECKING:
    from bestman_bt.manipulation.kinematics import StandAlong

DISTANCES = (0.55, 0.65, 0.75, 0.85, 0.95)
"""Metres from the middle of the pushed point's way to the middle of the base."""
BEARINGS = tuple(math.radians(degrees) for degrees in range(-90, 91, 15))
TURNS = (0.0, -0.5, 0.5)


class FindCloseStand(OnArm, Skill):
    """Choose where to stand so that the arm pushes a door or drawer shut from where it is believed to be.

    Each time it is asked again it gives another stand, until none is left.
    """

    REQUIRES = ("base", "lidar", "arm", "gripper")
    articulation = In[str](ArticulationName, "furniture/leaf of the map")
    stand = Out(Pose2D, "where to stand, in the map frame", required=True)
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "no_stand": "look where it stands now: FindLookStand, DetectHandle",
    }
    DECLARATION = Declaration(effects=("stand_known({articulation})",))

    def on_load(self) -> None:
        """Nothing has been tried yet."""
        self._tried: list[Pose2D] = []

    def execute(self) -> Steps:
        """For one way to push after another, until there is a stand for it."""
        leaf = find_leaf(self.skills, self.articulation)
        stands = yield self.compute("stand_planning", self._rank, leaf)
        if not stands:
            raise SkillFailure("no_stand", f"the arm cannot push {leaf.articulation} shut from anywhere free")
        best = stands[0].pose
        self._tried.append(best)
        self.stand = best
        self.feedback_message = f"stand at {best.x:.2f}, {best.y:.2f}, {np.degrees(best.theta):.0f}°"

    def _rank(self, leaf: Leaf) -> Sequence[StandAlong]:
        return find_stands(self.skills, leaf, self._ways(leaf))

    def _ways(self, leaf: Leaf) -> Iterator[LeafWay]:
        skills = self.skills
        is_base_free = None
        around: dict[tuple[float, ...], list[Pose2D]] = {}
        for push in pushes(skills, leaf):
            positions, point = push.positions(), tuple(push.point)
            is_base_free = is_base_free or room_beside(skills, leaf, positions)
            if point not in around:  # however the hand is held there
                around[point] = [stand for stand in _around(push) if self._is_new(stand) and is_base_free(stand)]
            yield LeafWay(around[point], [push.stations(BEFORE)[0], *push.stations()], positions, "fingers", skip=1)

    def _is_new(self, stand: Pose2D) -> bool:
        return all(stand.distance_to(tried) > SAME_STAND for tried in self._tried)


def _around(push: Push) -> tuple[Pose2D, ...]:
    from bestman_bt.manipulation.kinematics import stands_around

    middle = push.start / 2
    outward = -push.leaf.front(middle).rotation[:, 0]
    front = math.atan2(outward[1], outward[0])
    return stands_around(push.at(middle)[:2], DISTANCES, [front + bearing for bearing in BEARINGS], TURNS)
