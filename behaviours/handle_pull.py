"""Planning to take a handle and go with it: which grasp, by which way, and how arm and hand turn meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.grasp_candidates import handle_grasp_candidates
from behaviours.leaf import LeafWorlds, world_at_leaf
from behaviours.leaf_stand import LeafWay, stands_along_leaf
from behaviours.opening import FINGER_ROOM, Opening, before, guide, stations
from bestman_bt.world_model import HandleBelief

if TYPE_CHECKING:
    from bestman_bt.control.arm import FollowGuide
    from bestman_bt.perception.grasp_pose import GraspCandidate

ENOUGH = 1
"""Grasps from which the end of the way is reached, after which no further ones are looked at."""
GRASPS = 6
"""Different grasps that are looked at."""
SAME_PLACE = 0.02
"""Metres between the grasps of a bar that count as one."""
SAME_BRANCH = 0.3
"""Radians by which the straight way in may end beside the posture from which the arc was planned."""
DEPTH = 0.3
"""Share of what a bar stands off beyond the fingers' room by which it is held deeper than in the middle of the pads.

On the way it creeps towards the tips.
"""


@dataclass(frozen=True, eq=False)
class HandlePull:
    """``into``: (N, n) radians, the hand's straight way from before the handle around it. ``fingers``: how far open.

    ``reached``: share of the way that is in reach.
    """

    fingers: float
    into: NDArray[np.float64]
    guide: FollowGuide
    reached: float
    score: float

    @property
    def planned(self) -> float:
        """Share of the way for which the guide has postures: of its stations the first is where the handle is now."""
        stations = (len(self.guide.ways) + 1) / self.reached - 1  # but for the one before the handle
        return min(1.0, (len(self.guide.ways) - 1) / (stations - 1))


def plan_pull(skills: SkillContext, opening: Opening, belief: HandleBelief) -> HandlePull | None:
    """The grasp from which the arm gets farthest from where it stands; None if there is none within reach."""
    from bestman_bt.manipulation.kinematics import ArcStands, cartesian_path

    base_from_map, here = skills.map_from_base.inverse(), [skills.world.base.pose]
    free = world_at_leaf(skills, opening.leaf, opening.start, "free")
    contact = world_at_leaf(skills, opening.leaf, opening.start, "fingers")
    from_here = ArcStands(enough=1, most=1, starts=6, options=7, min_fraction=0.3)
    plans: list[HandlePull] = []
    worlds: LeafWorlds = {}
    for candidate in pull_grasps(skills, opening, belief):
        grasp, pre_grasp = skills.map_from_base @ candidate.grasp, skills.map_from_base @ candidate.pre_grasp
        tilts = opening.tilts(grasp)
        way = [before(opening, grasp, pre_grasp, tilts), *stations(opening, grasp, tilts)]
        along_leaf = LeafWay(here, way, opening.positions(), opening.touching, skip=1)
        for stand in stands_along_leaf(skills, opening.leaf, along_leaf, worlds, from_here):
            arc = replace(stand.arc, path=stand.arc.path[1:], options=stand.arc.options[1:])
            if len(arc.path) < 2 or not free.is_free(stand.arc.path[0]):
                continue
            around = base_from_map @ way[1][arc.options[0]]
            into = cartesian_path(skills.kinematics, stand.arc.path[0], around, contact.is_free)
            if into.complete and float(np.abs(into.path[-1] - arc.path[0]).max()) < SAME_BRANCH:
                along = guide(opening, grasp, arc, tilts)
                score = candidate.quality + np.sqrt(arc.margin)
                plans.append(HandlePull(candidate.opening, into.path, along, stand.arc.fraction, float(score)))
        if sum(plan.reached >= 1.0 for plan in plans) >= ENOUGH:
            break
    return max(plans, key=lambda plan: (plan.reached, plan.score)) if plans else None


def pull_grasps(skills: SkillContext, opening: Opening, belief: HandleBelief) -> list[GraspCandidate]:
    """Grasps of a believed handle in the base frame, best first.

    Of those that hold a bar at the same place with the same finger up, which are turns about it, only the best.
    """
    from bestman_bt.perception.grasp_pose import GraspRanking

    ranked = [entry.candidate for entry in GraspRanking().rank(handle_grasp_candidates(skills, belief))]
    if not opening.bar_turns:
        return ranked[:GRASPS]
    kept: list[GraspCandidate] = []
    for candidate in (_deeper(candidate, opening) for candidate in ranked):
        same = (
            np.linalg.norm(candidate.grasp.position - other.grasp.position) < SAME_PLACE
            and float(candidate.grasp.rotation[:, 1] @ other.grasp.rotation[:, 1]) > 0.0
            for other in kept
        )
        if not any(same):
            kept.append(candidate)
    return kept[:GRASPS]


def _deeper(candidate: GraspCandidate, opening: Opening) -> GraspCandidate:
    """The grasp with a bar nearer to the palm, where the finger tips have room before the front."""
    if opening.touching != "nothing":
        return candidate
    grasp, depth = candidate.grasp, DEPTH * (opening.handle.standoff - FINGER_ROOM)
    return replace(candidate, grasp=replace(grasp, position=grasp.position + depth * grasp.rotation[:, 2]))
