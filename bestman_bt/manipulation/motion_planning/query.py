"""The question to a motion planner, checked before any search: refusals name the joint or the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PathConstraint, PlanningErrorCode
from bestman_bt.messages import MotionObstacle, MotionStage


@dataclass(frozen=True, eq=False)
class PlanningQuery:
    """``start``, ``lower``, ``upper``: (n,) radians; ``goals``: the admissible ones, with their ``indices``."""

    start: NDArray[np.float64]
    goals: tuple[NDArray[np.float64], ...]
    indices: tuple[int, ...]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    def index_of(self, positions: NDArray[np.float64]) -> int:
        """Return the index, in the caller's list, of the goal at ``positions`` (n,)."""
        distances = [float(np.linalg.norm(goal - positions)) for goal in self.goals]
        return self.indices[int(np.argmin(distances))]


def check_query(
    start: ArrayLike,
    goals: Sequence[ArrayLike],
    world: CollisionWorld,
    limits: JointLimits,
    constraint: PathConstraint | None,
    limit_tolerance: float,
) -> PlanningQuery:
    """Check start and goals; the start may be ``limit_tolerance`` rad outside of its limits.

    Raises MotionPlanningError if the start, or every goal, violates limits, collision or constraint; ManipulationError
    for NaN, wrong shapes, no goals, or different joints of world and limits.
    """
    if world.joint_names != limits.joint_names:
        raise ManipulationError(
            f"the collision world moves {', '.join(world.joint_names)} but the limits are for "
            f"{', '.join(limits.joint_names)}"
        )
    count = len(limits.joint_names)
    if len(goals) == 0:
        raise ManipulationError("goals should hold at least one goal but is empty")
    origin = joint_vector(start, count, "start")
    targets = [joint_vector(goal, count, f"goal {i}") for i, goal in enumerate(goals)]
    _check_start(origin, world, limits, constraint, limit_tolerance)
    refusals = [_goal_refusal(i, goal, world, limits, constraint) for i, goal in enumerate(targets)]
    indices = [i for i, refusal in enumerate(refusals) if refusal is None]
    if not indices:
        for refusal in refusals:
            if refusal is not None:
                raise refusal
    return PlanningQuery(
        origin,
        tuple(targets[i] for i in indices),
        tuple(indices),
        np.minimum(limits.lower, origin),
        np.maximum(limits.upper, origin),
    )


def _check_start(
    start: NDArray[np.float64],
    world: CollisionWorld,
    limits: JointLimits,
    constraint: PathConstraint | None,
    tolerance: float,
) -> None:
    outside = _out_of_limits(start, limits, tolerance)
    if outside:
        raise MotionPlanningError(
            PlanningErrorCode.START_OUT_OF_LIMITS,
            f"the start is outside its limits: {outside}",
            at_limit(MotionStage.START, start, limits),
        )
    if not world.is_free(start):
        raise MotionPlanningError(
            PlanningErrorCode.START_IN_COLLISION,
            f"the start is in collision: {describe_contacts(world, start)}",
            in_the_way(MotionStage.START, world, start),
        )
    if constraint is not None and not constraint.satisfied(start):
        raise MotionPlanningError(
            PlanningErrorCode.START_VIOLATES_CONSTRAINT, f"the start violates: {constraint.description}"
        )


def _goal_refusal(
    index: int, goal: NDArray[np.float64], world: CollisionWorld, limits: JointLimits, constraint: PathConstraint | None
) -> MotionPlanningError | None:
    outside = _out_of_limits(goal, limits, 1e-6)
    if outside:
        return MotionPlanningError(
            PlanningErrorCode.GOAL_OUT_OF_LIMITS,
            f"goal {index} is outside the limits: {outside}",
            at_limit(MotionStage.GOAL, goal, limits),
        )
    if not world.is_free(goal):
        return MotionPlanningError(
            PlanningErrorCode.GOAL_IN_COLLISION,
            f"goal {index} is in collision: {describe_contacts(world, goal)}",
            in_the_way(MotionStage.GOAL, world, goal),
        )
    if constraint is not None and not constraint.satisfied(goal):
        return MotionPlanningError(
            PlanningErrorCode.GOAL_VIOLATES_CONSTRAINT, f"goal {index} breaks: {constraint.description}"
        )
    return None


def describe_contacts(world: CollisionWorld, positions: NDArray[np.float64]) -> str:
    """Return the colliding pairs as text, such as ``panda_hand with table``."""
    return ", ".join(f"{a} with {b}" for a, b in world.colliding_pairs(positions))


def in_the_way(stage: MotionStage, world: CollisionWorld, positions: NDArray[np.float64]) -> MotionObstacle:
    """Return the pairs that touch at ``positions`` (n,)."""
    return MotionObstacle(stage, world.colliding_pairs(positions), positions=_named(world.joint_names, positions))


def at_limit(stage: MotionStage, positions: NDArray[np.float64], limits: JointLimits) -> MotionObstacle:
    """Return the joint that is farthest beyond its limits at ``positions`` (n,)."""
    beyond = np.maximum(limits.lower - positions, positions - limits.upper)
    worst = int(beyond.argmax())
    named = _named(limits.joint_names, positions)
    return MotionObstacle(stage, (), limits.joint_names[worst], float(beyond[worst]), named)


def _named(names: Sequence[str], positions: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip(names, positions.tolist(), strict=True))


def _out_of_limits(positions: NDArray[np.float64], limits: JointLimits, tolerance: float) -> str:
    return ", ".join(
        f"{name} at {value:.4f}, allowed {low:.4f} to {high:.4f}"
        for name, value, low, high in zip(limits.joint_names, positions, limits.lower, limits.upper, strict=True)
        if not low - tolerance <= value <= high + tolerance
    )
