"""From start and goals to a motion that may be executed: plan, time, check the timed motion, else plan anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.escape import Escape
from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization
from bestman_bt.manipulation.trajectory.collision_check import dense_samples, first_touch
from bestman_bt.messages import JointTrajectory


@dataclass(frozen=True, eq=False)
class TimedPlan:
    """``trajectory``: checked, ready to follow. ``plan``: the path behind it. ``attempts``: plans it took."""

    trajectory: JointTrajectory
    plan: MotionPlan
    attempts: int


class TimedMotionPlanner:
    """Puts a planner and a time parametrisation together; what all arm skills use.

    ``attempts``: plans to try until a timed motion is free.
    """

    def __init__(self, planner: MotionPlanner, timing: TimeParametrization, attempts: int = 5) -> None:
        if attempts < 1:
            raise ManipulationError(f"TimedMotionPlanner attempts should be at least 1 but is {attempts}")
        self.planner = planner
        self.timing = timing
        self.attempts = attempts

    def plan(
        self,
        start: ArrayLike,
        goals: Sequence[ArrayLike],
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
        scale: SpeedScale | None = None,
        constraint: PathConstraint | None = None,
    ) -> TimedPlan:
        """A timed motion from ``start`` (n,) to one of ``goals``.

        Raises PlanningError if there is no path, or (``timed_path_invalid``) no timed motion that keeps clear.
        """
        reason = ""
        for attempt in range(1, self.attempts + 1):
            plan = self.planner.plan(start, goals, world, limits, rng, constraint)
            trajectory = self.timing.parametrize(plan.path, limits, scale)
            reason = why_invalid(trajectory, world, constraint)
            if not reason:
                return TimedPlan(trajectory, plan, attempt)
        raise PlanningError(
            PlanningErrorCode.TIMED_PATH_INVALID,
            f"none of {self.attempts} timed motions keeps clear; the last {reason}",
        )

    def escape(
        self,
        start: ArrayLike,
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
        scale: SpeedScale | None = None,
    ) -> JointTrajectory:
        """A small timed motion out of a ``start`` (n,) in collision, on which the clearance grows.

        Raises PlanningError (``start_in_collision``) where there is none, or the start is free already.
        """
        path = Escape().path(start, world, limits, rng)
        if len(path) == 1:
            raise PlanningError(
                PlanningErrorCode.START_IN_COLLISION, "there is nothing to escape from: the start is free"
            )
        return self.timing.parametrize(path, limits, scale)

    def follow_path(
        self,
        path: NDArray[np.float64],
        world: CollisionWorld,
        limits: JointLimits,
        scale: SpeedScale | None = None,
        constraint: PathConstraint | None = None,
    ) -> JointTrajectory:
        """Time a given path (N, n), for example a Cartesian one, and check it.

        Raises PlanningError (``timed_path_invalid``) if the timed motion touches.
        """
        trajectory = self.timing.parametrize(path, limits, scale)
        reason = why_invalid(trajectory, world, constraint)
        if reason:
            raise PlanningError(PlanningErrorCode.TIMED_PATH_INVALID, f"the timed motion {reason}")
        return trajectory


def why_invalid(trajectory: JointTrajectory, world: CollisionWorld, constraint: PathConstraint | None = None) -> str:
    """What is wrong with a timed motion, in words; empty if nothing is."""
    touch = first_touch(trajectory, world)
    if touch is not None:
        return f"touches {touch}"
    if constraint is not None:
        for time, positions in dense_samples(trajectory, 0.01, 0.01):
            if not constraint.tolerated(positions):
                return f"breaks at {time:.2f} s: {constraint.description}"
    return ""
