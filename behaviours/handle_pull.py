"""Planning to take a handle and go with it: which grasp, by which way, and how arm and hand turn meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from behaviours.context import SkillContext
from behaviours.grasp import handle_grasp_candidates
from behaviours.leaf import free_along, world_at_leaf
from behaviours.opening import Opening, guide, stations
from bestman_bt.control.arm import FollowGuide
from bestman_bt.manipulation.kinematics import arc_path_through
from bestman_bt.manipulation.motion_planning import Approach, approaches
from bestman_bt.perception.grasp_pose import GraspCandidate, rank_grasps
from bestman_bt.world_model import HandleBelief

ENOUGH = 3
"""Plans that reach the end of the way, among which the best is chosen."""

DEPTH = 0.006
"""Metres by which a bar is held deeper than in the middle of the pads: on the way it creeps towards the tips."""


@dataclass(frozen=True, eq=False)
class HandlePull:
    """``guide``: None where not even the second station is in reach. ``reached``: share of the way that is in reach."""

    candidate: GraspCandidate
    approach: Approach
    guide: FollowGuide | None
    reached: float
    score: float


def plan_pull(skills: SkillContext, opening: Opening, belief: HandleBelief) -> HandlePull | None:
    """The grasp from which the arm gets farthest from where it stands; None if no grasp is free and within reach."""
    kinematics, reference = skills.algorithms.kinematics, skills.arm_positions()
    base_from_map = skills.map_from_base.inverse()
    positions = opening.positions()
    free = world_at_leaf(skills, opening.leaf, opening.start, "free")
    contact = world_at_leaf(skills, opening.leaf, opening.start, "fingers")
    is_free = free_along(skills, opening.leaf, positions, opening.touching)
    plans: list[HandlePull] = []
    for ranked in rank_grasps(handle_grasp_candidates(skills, belief)):
        candidate = _deeper(ranked.candidate, opening)
        grasp = skills.map_from_base @ candidate.grasp
        tilts = opening.tilts(grasp)
        way = stations(opening, grasp, tilts, base_from_map)
        for approach in approaches(
            kinematics,
            candidate.pre_grasp,
            candidate.grasp,
            candidate.grasp,
            reference,
            free,
            contact,
            skills.rng,
            count=3,
        ):
            arc = arc_path_through(kinematics, way, 0, tilts.index(0.0), approach.into[-1], skills.arm_model, is_free)
            along = guide(opening, grasp, arc, tilts) if len(arc.path) > 1 else None
            score = ranked.score + 0.5 * float(np.sqrt(arc.margin))
            plans.append(HandlePull(candidate, approach, along, arc.fraction, score))
        if sum(plan.reached >= 1.0 for plan in plans) >= ENOUGH:
            break
    return max(plans, key=lambda plan: (plan.reached, plan.score)) if plans else None


def _deeper(candidate: GraspCandidate, opening: Opening) -> GraspCandidate:
    """The grasp with a bar nearer to the palm, where the finger tips have room before the front."""
    if opening.touching != "nothing":
        return candidate
    grasp = candidate.grasp
    return replace(candidate, grasp=replace(grasp, position=grasp.position + DEPTH * grasp.rotation[:, 2]))
