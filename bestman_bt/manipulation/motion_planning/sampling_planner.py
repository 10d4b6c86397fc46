"""What all sampling planners share: the straight way first, searches from fresh seeds, shortcuts, a fine check."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges
from bestman_bt.manipulation.motion_planning.query import PlanningQuery, check_query
from bestman_bt.manipulation.motion_planning.shortcut import shortcut
from bestman_bt.manipulation.motion_planning.validity import CountedValidity
from bestman_bt.messages.bounds import Count, NonNegative, Positive, WholeNumber

WAY_SAMPLES = 50
"""Configurations that are looked at to say what stands in the way where no path was found."""


@dataclass(frozen=True)
class SamplingPlanner(MotionPlanner):
    """A planner that searches by random samples; subclasses only search.

    The result depends on the arguments alone: every search is seeded from ``rng`` and ends by counts, not by time.

    ``check_step``, ``final_check_step``: rad between checked points while planning, and of the finished path.
    ``max_checks``: collision checks after which an attempt ends; ``max_iterations``: of the search.
    ``attempts``: searches from fresh seeds. ``shortcut_attempts``, ``shortcut_patience``: see ``shortcut``.
    ``limit_tolerance``: rad by which the start may lie outside its limits (an arm that sags or overshoots).
    ``wall_limit``: seconds after which planning is aborted with an error; what it answers never depends on it.
    """

    check_step: Annotated[Positive, "rad"] = 0.03
    final_check_step: Annotated[Positive, "rad"] = 0.01
    max_checks: Count = 60_000
    max_iterations: Count = 20_000
    attempts: Count = 2
    shortcut_attempts: WholeNumber = 100
    shortcut_patience: WholeNumber = 25
    limit_tolerance: Annotated[NonNegative, "rad"] = 0.01
    wall_limit: Annotated[Positive, "s"] = 60.0

    @abstractmethod
    def search(self, query: PlanningQuery, validity: CountedValidity, seed: int) -> NDArray[np.float64] | None:
        """A path (N, n) from the query's start to one of its goals, or None within the limits of one attempt."""

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
        validity = CountedValidity(world, constraint, self.wall_limit)
        edges = CheckedEdges(validity, self.check_step, self.final_check_step)
        for goal in sorted(query.goals, key=lambda q: float(np.linalg.norm(q - query.start))):
            if edges.is_free(query.start, goal, fine=True):
                return MotionPlan(np.array([query.start, goal]), query.index_of(goal), validity.checks)
        for _ in range(self.attempts):
            found = self.search(query, validity, int(rng.integers(1, 2**31 - 1)))
            if found is None:
                continue
            path = self.shorten(found, edges, rng)
            if path is not None:
                return MotionPlan(path, query.index_of(path[-1]), validity.checks)
        raise PlanningError(
            PlanningErrorCode.NO_PATH,
            f"{type(self).__name__} found no path to any of {len(query.goals)} goals after {validity.checks} "
            f"collision checks{_in_the_way(query, world)}",
        )

    def shorten(
        self, found: NDArray[np.float64], edges: CheckedEdges, rng: np.random.Generator
    ) -> NDArray[np.float64] | None:
        """A path that is never longer and finely checked, or None if ``found`` (N, n) does not stand the check."""
        return shortcut(found, edges, rng, self.shortcut_attempts, self.shortcut_patience)


def _in_the_way(query: PlanningQuery, world: CollisionWorld) -> str:
    """The pair that collides most often on the straight way to the nearest goal, in words; empty without one."""
    nearest = min(query.goals, key=lambda goal: float(np.linalg.norm(goal - query.start)))
    way = np.linspace(query.start, nearest, WAY_SAMPLES)
    pairs = Counter(pair for positions in way for pair in world.colliding_pairs(positions))
    if not pairs:
        return ""
    (first, second), _ = pairs.most_common(1)[0]
    return f"; on the straight way {first} and {second} collide"
