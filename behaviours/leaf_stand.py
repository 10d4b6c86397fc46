"""Where the base may stand while the arm moves a door or drawer, and from where the arm follows it all the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.context import DRIVEN, SkillContext
from behaviours.leaf import Leaf, LeafWorlds, Touching, free_along
from bestman_bt.messages import Box, Pose2D

if TYPE_CHECKING:
    from bestman_bt.manipulation.kinematics import ArcStands, ReachabilityMap, StandAlong, Stations

BASE_GAP = 0.05
"""Metres that the robot's body keeps from where the leaf passes."""
SAME_STAND = 0.05
BATCHES = (slice(0, 6), slice(6, 18))
"""Which of the most promising stands are looked at for all ways first, and then, where none is good."""
ROOM = 0.05
"""Share of half their ranges that the joints keep on a way that is good enough to look no further."""
ACROSS = np.linspace(-0.5, 0.5, 9)
"""Places on a front, as shares of its width, that stand for all of it."""


def room_beside(skills: SkillContext, leaf: Leaf, positions: Sequence[float]) -> Callable[[Pose2D], bool]:
    """Whether the base has room at a stand (map frame) and its body is where the leaf does not pass at ``positions``.

    Body and head may be below or above the leaf; the arm is not looked at.
    """
    from bestman_bt.manipulation.kinematics import body_between

    front = leaf.leaf.shapes[0]
    assert isinstance(front.shape, Box)
    height, thickness = front.shape.size[2], front.shape.size[0]
    low = float(front.pose.position[2]) - height / 2
    body = body_between(skills.robot, skills.joints.positions(), skills.arm.name, low - BASE_GAP, low + height)
    swept = swept_by(leaf, positions)
    clearance = skills.known_costmap(DRIVEN).clearance_at

    def is_free(stand: Pose2D) -> bool:
        if clearance(stand) <= 0.0:
            return False
        if body is None:
            return True
        local = stand.inverse().apply(swept)
        gap = BASE_GAP + thickness / 2
        return not bool(((local > body[0] - gap) & (local < body[1] + gap)).all(axis=1).any())

    return is_free


def swept_by(leaf: Leaf, positions: Sequence[float]) -> NDArray[np.float64]:
    """Points (N, 2) of the map over which the front passes."""
    front = leaf.leaf.shapes[0]
    assert isinstance(front.shape, Box)
    across = np.column_stack([np.zeros(len(ACROSS)), ACROSS * front.shape.size[1], np.zeros(len(ACROSS))])
    return np.concatenate([leaf.front(position).apply(across)[:, :2] for position in positions])


@dataclass(frozen=True, eq=False)
class LeafWay:
    """One way to move a leaf: from one of ``stands`` the arm would follow ``stations``, both in the map frame.

    ``positions``: where the leaf is meanwhile. ``touching``, ``skip``: as in ``free_along``.
    """

    stands: Sequence[Pose2D]
    stations: Stations
    positions: Sequence[float]
    touching: Touching
    skip: int = 0


def find_stands(skills: SkillContext, leaf: Leaf, ways: Iterable[LeafWay]) -> list[StandAlong]:
    """Stands from which the arm follows the whole of one of ``ways``, best first; empty if there is none.

    The arm's reachability map says which stands are looked at, so that few paths are searched in vain.
    """
    from bestman_bt.manipulation.kinematics import ArcStands

    kinematics, current = skills.kinematics, skills.world.base.pose
    reachability = _reachability(skills)
    found: list[StandAlong] = []
    promising: list[LeafWay] = []
    worlds: LeafWorlds = {}
    few = ArcStands(enough=2, starts=3)
    for batch in BATCHES:
        for way in promising or ways:
            if batch is BATCHES[0]:
                stands = way.stands
                if reachability is not None:
                    stands = ArcStands().promising(stands, way.stations, kinematics, reachability, current)
                way = replace(way, stands=stands)
                promising.append(way)
            these = replace(way, stands=way.stands[batch])
            found += stands_along_leaf(skills, leaf, these, worlds, few, reachability)
            if any(stand.arc.margin >= ROOM for stand in found):
                return sorted(found, key=lambda stand: -stand.score)
    return sorted(found, key=lambda stand: -stand.score)


def stands_along_leaf(
    skills: SkillContext,
    leaf: Leaf,
    way: LeafWay,
    worlds: LeafWorlds,
    search: ArcStands,
    reachability: ReachabilityMap | None = None,
) -> tuple[StandAlong, ...]:
    """Of the stands of ``way`` those, best first, from which the arm follows it while the leaf moves.

    ``worlds``: as in ``free_along``.
    """
    return search.rank(
        way.stands,
        way.stations,
        skills.kinematics,
        skills.arm_model,
        skills.arm_positions(),
        skills.rng,
        reachability,
        is_free_at=lambda stand: free_along(skills, leaf, way.positions, way.touching, stand, way.skip, worlds),
        current=skills.world.base.pose,
    )


def _reachability(skills: SkillContext) -> ReachabilityMap | None:
    """The arm's map, from the disk; None where the kinematics in use has none."""
    from bestman_bt.manipulation.kinematics import reachability_map

    return reachability_map(skills.kinematics, skills.arm_model) if skills.kinematics.fingerprint else None
