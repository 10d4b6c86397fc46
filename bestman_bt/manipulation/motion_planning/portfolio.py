"""Several planners as one: the first path found, or the best of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from annotated_types import MinLen
from numpy.typing import ArrayLike

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    MotionPlanningError,
    PathConstraint,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.ompl_planners import AORRTC, BIT_STAR, KPIECE, RRT_STAR
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingPlanner
from bestman_bt.messages.shapes import Count

_MEMBERS: dict[str, SamplingPlanner] = {
    "aorrtc": AORRTC,
    "bit_star": BIT_STAR,
    "kpiece": KPIECE,
    "rrt_connect": RRTConnect(),
    "rrt_star": RRT_STAR,
}
Member = Literal["aorrtc", "bit_star", "kpiece", "rrt_connect", "rrt_star"]


@dataclass(frozen=True)
class Portfolio(MotionPlanner):
    """Runs its planners in turn, each with its own generator: RRT-Connect is fast, KPIECE explores differently.

    They run in sequence, because OMPL seeds all generators of a process from one, and a collision world serves one
    thread at a time, so that parallel planners would be non-deterministic. Evaluations use a single planner, to
    attribute their figures.

    ``planners``: names of registered sampling planners. ``take``: ``first`` path, or ``best`` (shortest) of all.
    ``impatience``: collision checks after which the next planner runs with ``first``; the last one may use all of its
    own.
    """

    planners: Annotated[tuple[Member, ...], MinLen(1)] = ("rrt_connect", "kpiece")
    take: Literal["first", "best"] = "first"
    impatience: Count = 20_000

    @cached_property
    def members(self) -> Sequence[MotionPlanner]:
        """The planners, in order."""
        members = [_MEMBERS[name] for name in self.planners]
        if self.take == "best":
            return members
        impatient = [replace(one, max_checks=min(self.impatience, one.max_checks), attempts=1) for one in members[:-1]]
        return [*impatient, members[-1]]

    def plan(
        self,
        start: ArrayLike,
        goals: Sequence[ArrayLike],
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
        constraint: PathConstraint | None = None,
    ) -> MotionPlan:
        """Plan from ``start`` to any of ``goals``; see the base class."""
        failures: list[MotionPlanningError] = []
        plans: list[MotionPlan] = []
        for planner, own in zip(self.members, rng.spawn(len(self.members)), strict=True):
            try:
                plans.append(planner.plan(start, goals, world, limits, own, constraint))
            except MotionPlanningError as error:
                if error.code not in (PlanningErrorCode.NO_PATH, PlanningErrorCode.TIMEOUT):
                    raise
                failures.append(error)
                continue
            if self.take == "first":
                break
        if not plans:
            last = failures[-1].failure.obstacle
            raise MotionPlanningError(PlanningErrorCode.NO_PATH, "; ".join(map(str, failures)), last)
        return min(plans, key=lambda plan: plan.length)
