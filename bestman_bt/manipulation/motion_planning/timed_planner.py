"""From start and goals to an executable motion: plan, time, check the timed motion; repeat on failure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    MotionPlanningError,
    PathConstraint,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.query import in_the_way
from bestman_bt.manipulation.trajectory.base import SpeedScale, TimeParametrization, dense_samples, first_touch
from bestman_bt.messages import JointTrajectory, MotionStage

# The way out of a start in collision: a small motion on which the clearance grows from step to step.
# Ascent of the clearance, as medial-axis PRM retracts samples (Wilmarth, Amato and Stiller, "MAPRM", ICRA 1999), by
# finite differences; where bodies on two sides make the gradient useless, by the best of some random directions.


_DIFFERENCE = 1e-4
_HALVINGS = 4


@dataclass(frozen=True)
class CollisionRecovery:
    """Moves an arm out of a start in collision.

    ``step``: largest joint motion per step, radians; ``largest_motion``: largest total motion of a joint, radians.

    ``deepest``: metres of overlap, padding included, beyond which the belief is assumed wrong and the arm does not
    move. ``spare``: metres of clearance at which the motion ends. ``directions``: number of random directions to try.
    """

    step: float = 0.01
    largest_motion: float = 0.35
    deepest: float = 0.03
    spare: float = 0.002
    directions: int = 24

    def path(
        self, start: ArrayLike, world: CollisionWorld, limits: JointLimits, rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Return waypoints (N, n), radians, from ``start`` to a free configuration, with increasing clearance.

        One row if the start is free. Raises MotionPlanningError (``start_in_collision``) naming the pairs if they
        overlap too far, or no small motion helps.
        """
        origin = joint_vector(start, len(limits.joint_names), "start of a collision recovery")
        path = [origin]
        if world.is_free(origin):
            return np.array(path)
        clearance = world.clearance(origin)
        if clearance < -self.deepest:
            raise _refusal(origin, world, f"by {-1e3 * clearance:.0f} mm, too far to move out of it")
        while clearance < self.spare or not world.is_free(path[-1]):
            found = self._better(path[-1], clearance, world, limits, rng)
            if found is None:
                if world.is_free(path[-1]):
                    break
                raise _refusal(origin, world, "and no small motion leads out of it")
            positions, clearance = found
            if np.abs(positions - origin).max() > self.largest_motion:
                raise _refusal(origin, world, f"and {self.largest_motion:g} rad of motion do not lead out of it")
            path.append(positions)
        return np.array(path)

    def _better(
        self,
        positions: NDArray[np.float64],
        clearance: float,
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.float64], float] | None:
        """Return a step with more clearance, or None if none is found."""
        gradient = _gradient(positions, clearance, world)
        for halving in range(_HALVINGS):
            found = _step(positions, gradient, self.step / 2**halving, world, limits)
            if found is not None and found[1] > clearance:
                return found
        tried = [
            found
            for direction in rng.normal(size=(self.directions, len(positions)))
            if (found := _step(positions, direction, self.step, world, limits)) is not None
        ]
        best = max(tried, key=lambda found: found[1], default=None)
        return best if best is not None and best[1] > clearance else None


def _step(
    positions: NDArray[np.float64],
    direction: NDArray[np.float64],
    length: float,
    world: CollisionWorld,
    limits: JointLimits,
) -> tuple[NDArray[np.float64], float] | None:
    largest = float(np.abs(direction).max())
    if largest == 0.0:
        return None
    # A start may be a little outside the limits; never further.
    lower, upper = np.minimum(limits.lower, positions), np.maximum(limits.upper, positions)
    moved = np.clip(positions + length / largest * direction, lower, upper)
    return moved, world.clearance(moved)


def _gradient(positions: NDArray[np.float64], clearance: float, world: CollisionWorld) -> NDArray[np.float64]:
    steps = positions + _DIFFERENCE * np.eye(len(positions))
    return np.array([world.clearance(step) - clearance for step in steps]) / _DIFFERENCE


def _refusal(origin: NDArray[np.float64], world: CollisionWorld, why: str) -> MotionPlanningError:
    pairs = ", ".join(f"{a} with {b}" for a, b in world.colliding_pairs(origin))
    obstacle = in_the_way(MotionStage.START, world, origin)
    return MotionPlanningError(
        PlanningErrorCode.START_IN_COLLISION, f"the start is in collision: {pairs}, {why}", obstacle
    )


@dataclass(frozen=True, eq=False)
class TimedPlan:
    """A checked ``trajectory`` and the ``plan`` behind it. ``attempts``: number of plans needed."""

    trajectory: JointTrajectory
    plan: MotionPlan
    attempts: int


class TimedMotionPlanner:
    """Combines a planner and a time parametrisation for all arm skills.

    ``attempts``: number of plans until a timed motion is free.
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
        """Return a timed motion from ``start`` (n,) to one of ``goals``.

        Raises MotionPlanningError if there is no path, or (``timed_path_invalid``) no collision-free timed motion.
        """
        fault: MotionPlanningError | None = None
        for attempt in range(1, self.attempts + 1):
            plan = self.planner.plan(start, goals, world, limits, rng, constraint)
            trajectory = self.timing.parametrize(plan.path, limits, scale)
            fault = why_invalid(trajectory, world, constraint)
            if fault is None:
                return TimedPlan(trajectory, plan, attempt)
        assert fault is not None  # there is at least one attempt
        message = f"none of {self.attempts} timed motions keeps clear; the last {fault}"
        raise MotionPlanningError(fault.code, message, fault.failure.obstacle)

    def recover(
        self,
        start: ArrayLike,
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
        scale: SpeedScale | None = None,
    ) -> JointTrajectory:
        """Return a small timed motion out of a ``start`` (n,) in collision, with increasing clearance.

        Raises MotionPlanningError (``start_in_collision``) if there is none, or if the start is already free.
        """
        path = CollisionRecovery().path(start, world, limits, rng)
        if len(path) == 1:
            raise MotionPlanningError(
                PlanningErrorCode.START_IN_COLLISION, "the start is not in collision: there is nothing to recover from"
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

        Raises MotionPlanningError (``timed_path_invalid``) if the timed motion collides.
        """
        trajectory = self.timing.parametrize(path, limits, scale)
        fault = why_invalid(trajectory, world, constraint)
        if fault is not None:
            raise MotionPlanningError(fault.code, f"the timed motion {fault}", fault.failure.obstacle)
        return trajectory


def why_invalid(
    trajectory: JointTrajectory, world: CollisionWorld, constraint: PathConstraint | None = None
) -> MotionPlanningError | None:
    """Return the fault of a timed motion: ``touches ...``, or ``breaks at ...``; or None."""
    touch = first_touch(trajectory, world)
    if touch is not None:
        obstacle = in_the_way(MotionStage.TIMED_MOTION, world, trajectory.sample(touch.time)[0])
        pairs = replace(obstacle, pairs=touch.pairs)
        return MotionPlanningError(PlanningErrorCode.TIMED_PATH_INVALID, f"touches {touch}", pairs)
    if constraint is not None:
        for time, positions in dense_samples(trajectory, 0.01, 0.01):
            if not constraint.tolerated(positions):
                words = f"breaks at {time:.2f} s: {constraint.description}"
                return MotionPlanningError(PlanningErrorCode.TIMED_PATH_INVALID, words)
    return None
