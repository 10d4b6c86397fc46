"""Plans that have been made before, given out again where they still hold."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.base import MotionPlan, MotionPlanner, PathConstraint
from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges
from bestman_bt.manipulation.motion_planning.ompl_planners import RRTConnect
from bestman_bt.manipulation.motion_planning.query import check_query
from bestman_bt.manipulation.motion_planning.validity import CountedValidity
from bestman_bt.messages.bounds import Count, Positive

_Key = tuple[str, str, bytes, tuple[bytes, ...]]


@dataclass(eq=False)
class PathCache(MotionPlanner):
    """A planner that asks ``planner`` only for what it does not know.

    Paths are kept by quantised start and goals, the constraint, and the fingerprint of the collision world; whatever
    the fingerprint says, a path is checked again in the present world before it is given out, and forgotten where it
    touches. Unlike with other planners, an answer depends on earlier questions: leave it out of evaluations.

    ``quantum``: rad; starts and goals in the same cell of this size share a path. ``size``: paths that are kept.
    ``check_step``: rad between checked points. ``limit_tolerance``: rad by which the start may lie outside its limits.
    ``wall_limit``: seconds after which checking is aborted with an error.
    ``hits``, ``misses``: questions answered from memory, and passed on.
    """

    planner: RRTConnect = field(default_factory=RRTConnect)
    quantum: Annotated[Positive, "rad"] = 0.02
    size: Count = 200
    check_step: Annotated[Positive, "rad"] = 0.01
    limit_tolerance: Annotated[Positive, "rad"] = 0.01
    wall_limit: Annotated[Positive, "s"] = 60.0
    hits: int = field(default=0, init=False)
    misses: int = field(default=0, init=False)
    _plans: OrderedDict[_Key, MotionPlan] = field(default_factory=OrderedDict, init=False, repr=False)

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
        query = check_query(start, goals, world, limits, constraint, self.limit_tolerance)
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
            validity = CountedValidity(world, constraint, self.wall_limit)
            step = self.check_step
            if CheckedEdges(validity, step, step).is_path_free(path):
                self._plans.move_to_end(key)
                self.hits += 1
                return MotionPlan(path, known.goal_index, validity.checks)
            del self._plans[key]
        self.misses += 1
        plan = self.planner.plan(start, goals, world, limits, rng, constraint)
        self._plans[key] = plan
        if len(self._plans) > self.size:
            self._plans.popitem(last=False)
        return plan

    def _cell(self, positions: NDArray[np.float64]) -> bytes:
        return np.round(positions / self.quantum).astype(np.int64).tobytes()
