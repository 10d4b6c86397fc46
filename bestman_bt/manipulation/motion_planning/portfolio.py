"""Several planners behind one: the first that finds a path, or the best of all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.aorrtc import AORRTC
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.bit_star import BITStar
from bestman_bt.manipulation.motion_planning.kpiece import KPIECE
from bestman_bt.manipulation.motion_planning.prm import PRM
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.rrt_star import RRTStar
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingPlanner

_MEMBERS: dict[str, Callable[[], SamplingPlanner]] = {
    "aorrtc": AORRTC,
    "bit_star": BITStar,
    "kpiece": KPIECE,
    "prm": PRM,
    "rrt_connect": RRTConnect,
    "rrt_star": RRTStar,
}


@dataclass(frozen=True)
class PortfolioParameters:
    """``planners``: names of sampling planners, as they are registered.

    ``take``: ``first`` found, or ``best`` (shortest) of all. ``impatience``: collision checks after which the next
    planner is asked where the first path is taken; the last one may use all of its own.
    """

    planners: tuple[str, ...] = ("rrt_connect", "kpiece")
    take: str = "first"
    impatience: int = 3000

    def __post_init__(self) -> None:
        if not self.planners:
            raise ManipulationError("PortfolioParameters planners should name at least one planner but is empty")
        if unknown := [name for name in self.planners if name not in _MEMBERS]:
            raise ManipulationError(
                f"PortfolioParameters planners should be among {', '.join(_MEMBERS)} but has {', '.join(unknown)}"
            )
        if self.take not in ("first", "best"):
            raise ManipulationError(f"PortfolioParameters take should be 'first' or 'best' but is {self.take!r}")
        if self.impatience < 1:
            raise ManipulationError(f"PortfolioParameters impatience should be above 0 but is {self.impatience}")


class Portfolio(MotionPlanner):
    """Asks its planners in turn, each with its own generator: RRT-Connect is quick and KPIECE gets through anything.

    In turn and not at once: OMPL seeds all generators of a process from one, and a collision world answers one thread
    at a time, so planners that race would answer differently from run to run. Evaluations use a single planner all
    the same, so that figures say which one they are of.
    """

    def __init__(
        self, parameters: PortfolioParameters | None = None, planners: Sequence[MotionPlanner] | None = None
    ) -> None:
        self.parameters = parameters or PortfolioParameters()
        self._planners = planners

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
        if self._planners is None:
            self._planners = self._make()
        failures: list[str] = []
        plans: list[MotionPlan] = []
        for planner, own in zip(self._planners, rng.spawn(len(self._planners)), strict=True):
            try:
                plans.append(planner.plan(start, goals, world, limits, own, constraint))
            except PlanningError as error:
                if error.code not in (PlanningErrorCode.NO_PATH, PlanningErrorCode.TIMEOUT):
                    raise
                failures.append(str(error))
                continue
            if self.parameters.take == "first":
                break
        if not plans:
            raise PlanningError(PlanningErrorCode.NO_PATH, "; ".join(failures))
        return min(plans, key=lambda plan: plan.length)

    def _make(self) -> list[SamplingPlanner]:
        parameters = self.parameters
        planners = [_MEMBERS[name]() for name in parameters.planners]
        if parameters.take == "first":
            for planner in planners[:-1]:
                most = min(parameters.impatience, planner.parameters.max_checks)
                planner.parameters = replace(planner.parameters, max_checks=most, attempts=1)
        return planners
