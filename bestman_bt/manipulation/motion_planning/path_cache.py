"""Plans that have been made before, given out again where they still hold."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.base import MotionPlan, MotionPlanner, PathConstraint
from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges
from bestman_bt.manipulation.motion_planning.query import check_query
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.validity import CountedValidity

_Key = tuple[str, str, bytes, tuple[bytes, ...]]


@dataclass(frozen=True)
class PathCacheParameters:
    """``quantum``: rad; starts and goals in the same cell of this size share a path. ``size``: paths that are kept.

    ``check_step``: rad between checked points. ``limit_tolerance``: rad by which the start may lie outside its limits.
    ``wall_limit``: seconds after which checking is aborted with an error.
    """

    quantum: Annotated[float, "rad"] = 0.02
    size: int = 200
    check_step: Annotated[float, "rad"] = 0.01
    limit_tolerance: Annotated[float, "rad"] = 0.01
    wall_limit: Annotated[float, "s"] = 60.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0:
                raise ManipulationError(f"PathCacheParameters {name} should be above 0 but is {value}")


class PathCache(MotionPlanner):
    """A planner that asks ``planner`` only for what it does not know.

    Paths are kept by quantised start and goals, the constraint, and the fingerprint of the collision world; whatever
    the fingerprint says, a path is checked again in the present world before it is given out, and forgotten where it
    touches. Unlike with other planners, an answer depends on earlier questions: leave it out of evaluations.

    ``hits``, ``misses``: questions answered from memory, and passed on.
    """

    def __init__(self, planner: MotionPlanner | None = None, parameters: PathCacheParameters | None = None) -> None:
        self.parameters = parameters or PathCacheParameters()
        self._planner = planner or RRTConnect()
        self._plans: OrderedDict[_Key, MotionPlan] = OrderedDict()
        self.hits = 0
        self.misses = 0

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
        query = check_query(start, goals, world, limits, constraint, self.parameters.limit_tolerance)
        targets = [np.asarray(goal, dtype=float) for goal in goals]
        key: _Key = (
            world.fingerprint,
            "" if constraint is None else constraint.description,
            self._cell(query.start),
            tuple(self._cell(goal) for goal in targets),
        )
        known = self._plans.get(key)
        if known is not None:
            path = known.path.copy()
            path[0], path[-1] = query.start, targets[known.goal_index]
            validity = CountedValidity(world, constraint, self.parameters.wall_limit)
            step = self.parameters.check_step
            if CheckedEdges(validity, step, step).is_path_free(path):
                self._plans.move_to_end(key)
                self.hits += 1
                return MotionPlan(path, known.goal_index, validity.checks)
            del self._plans[key]
        self.misses += 1
        plan = self._planner.plan(start, goals, world, limits, rng, constraint)
        self._plans[key] = plan
        if len(self._plans) > self.parameters.size:
            self._plans.popitem(last=False)
        return plan

    def _cell(self, positions: NDArray[np.float64]) -> bytes:
        return np.round(positions / self.parameters.quantum).astype(np.int64).tobytes()
