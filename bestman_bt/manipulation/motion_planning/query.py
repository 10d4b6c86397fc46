"""The query to a motion planner, checked before any search: errors name the joint or the bodies."""

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
    """Check start and goals; the start may be ``limit_tolerance`` rad outside its limits.

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
    refused = _refusal(MotionStage.START, "the start", origin, world, limits, constraint, limit_tolerance)
    if refused is not None:
        raise refused
    refusals = [
        _refusal(MotionStage.GOAL, f"goal {i}", goal, world, limits, constraint, 1e-6) for i, goal in enumerate(targets)
    ]
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


_START = (
    PlanningErrorCode.START_OUT_OF_LIMITS,
    PlanningErrorCode.START_IN_COLLISION,
    PlanningErrorCode.START_VIOLATES_CONSTRAINT,
)
_GOAL = (
    PlanningErrorCode.GOAL_OUT_OF_LIMITS,
    PlanningErrorCode.GOAL_IN_COLLISION,
    PlanningErrorCode.GOAL_VIOLATES_CONSTRAINT,
)


def _refusal(
    stage: MotionStage,
    what: str,
    positions: NDArray[np.float64],
    world: CollisionWorld,
    limits: JointLimits,
    constraint: PathConstraint | None,
    tolerance: float,
) -> MotionPlanningError | None:
    """Return why ``positions`` (n,), radians, are refused, or None. ``what``: their name in the message."""
    out_of_limits, in_collision, violates_constraint = _START if stage is MotionStage.START else _GOAL
    if outside := _out_of_limits(positions, limits, tolerance):
        message = f"{what} is outside its limits: {outside}"
        return MotionPlanningError(out_of_limits, message, at_limit(stage, positions, limits))
    if not world.is_free(positions):
        message = f"{what} is in collision: {describe_contacts(world, positions)}"
        return MotionPlanningError(in_collision, message, in_the_way(stage, world, positions))
    if constraint is not None and not constraint.satisfied(positions):
        return MotionPlanningError(violates_constraint, f"{what} violates: {constraint.description}")
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
