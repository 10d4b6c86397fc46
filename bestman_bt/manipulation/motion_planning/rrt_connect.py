"""Motion planning by RRT-Connect, from OMPL.

Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000;
Sucan, Moll and Kavraki, "The Open Motion Planning Library", 2012.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from ompl import base, geometric, util

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
from bestman_bt.manipulation.motion_planning.edge import dense_points, is_edge_valid
from bestman_bt.manipulation.motion_planning.query import PlanningQuery, check_query
from bestman_bt.manipulation.motion_planning.shortcut import shortcut


@dataclass(frozen=True)
class RRTConnectParameters:
    """``check_step``, ``final_check_step``: rad between checked points while planning, and of the finished path.

    ``max_checks``: collision checks after which an attempt ends; ``max_iterations``: of RRT-Connect.
    ``attempts``: searches from fresh trees. ``shortcut_attempts``, ``shortcut_patience``: see ``shortcut``.
    ``limit_tolerance``: rad by which the start may lie outside its limits (an arm that sags or overshoots).
    """

    check_step: float = 0.02
    final_check_step: float = 0.01
    max_checks: int = 60_000
    max_iterations: int = 20_000
    attempts: int = 2
    shortcut_attempts: int = 100
    shortcut_patience: int = 40
    limit_tolerance: float = 0.01

    def __post_init__(self) -> None:
        for name in ("check_step", "final_check_step", "max_checks", "max_iterations", "attempts"):
            if getattr(self, name) <= 0:
                raise ManipulationError(f"RRTConnectParameters {name} should be above 0 but is {getattr(self, name)}")


class RRTConnect(MotionPlanner):
    """Two trees that grow towards each other, then shortcuts; a straight way is taken without a search.

    The result depends on the arguments alone: OMPL's generators are seeded from ``rng`` before each search, and it
    ends by counts, not by time.
    """

    def __init__(self, parameters: RRTConnectParameters | None = None) -> None:
        self.parameters = parameters or RRTConnectParameters()

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
        validity = _CountedValidity(world, constraint)
        for goal in sorted(query.goals, key=lambda q: float(np.linalg.norm(q - query.start))):
            if self._is_edge_free(query.start, goal, validity):
                path = np.array([query.start, goal])
                if self._is_path_free(path, validity):
                    return MotionPlan(path, query.index_of(goal), validity.checks)
        for _ in range(self.parameters.attempts):
            found = self._search(query, validity, int(rng.integers(1, 2**31 - 1)))
            if found is None:
                continue
            path = shortcut(
                found,
                lambda a, b: self._is_edge_free(a, b, validity),
                rng,
                self.parameters.shortcut_attempts,
                self.parameters.shortcut_patience,
            )
            for candidate in (path, found):
                if self._is_path_free(candidate, validity):
                    return MotionPlan(candidate, query.index_of(candidate[-1]), validity.checks)
        raise PlanningError(
            PlanningErrorCode.NO_PATH,
            f"no path to any of {len(query.goals)} goals after {validity.checks} collision checks",
        )

    def _search(self, query: PlanningQuery, validity: _CountedValidity, seed: int) -> NDArray[np.float64] | None:
        count = len(query.start)
        with _quiet_ompl():
            # OMPL draws the seeds of all generators made from here on from this one; no generator outlives the call.
            util.RNG.setSeed(seed)
            space = base.RealVectorStateSpace(count)
            bounds = base.RealVectorBounds(count)
            for i in range(count):
                bounds.setLow(i, float(query.lower[i]))
                bounds.setHigh(i, float(query.upper[i]))
            space.setBounds(bounds)
            setup = geometric.SimpleSetup(space)
            setup.setStateValidityChecker(lambda state: validity(np.array(state[0:count])))
            information = setup.getSpaceInformation()
            information.setStateValidityCheckingResolution(self.parameters.check_step / space.getMaximumExtent())
            setup.addStartState(_state(information, query.start))
            targets = base.GoalStates(information)
            for goal in query.goals:
                targets.addState(_state(information, goal))
            setup.setGoal(targets)
            setup.setPlanner(geometric.RRTConnect(information))
            setup.solve(base.PlannerTerminationCondition(self._limit(validity)))
            # An "approximate" solution is truthy too: only an exact one counts.
            if not setup.haveExactSolutionPath():
                return None
            return np.array([state[0:count] for state in setup.getSolutionPath().getStates()])

    def _limit(self, validity: _CountedValidity) -> Callable[[], bool]:
        last_check = validity.checks + self.parameters.max_checks
        iterations = 0

        def is_over() -> bool:
            nonlocal iterations
            iterations += 1
            return iterations > self.parameters.max_iterations or validity.checks > last_check

        return is_over

    def _is_edge_free(self, a: NDArray[np.float64], b: NDArray[np.float64], validity: _CountedValidity) -> bool:
        return is_edge_valid(a, b, validity, self.parameters.check_step)

    def _is_path_free(self, path: NDArray[np.float64], validity: _CountedValidity) -> bool:
        return all(validity(q) for q in dense_points(path, self.parameters.final_check_step))


class _CountedValidity:
    """Free of collisions and within the constraint, as a Python ``bool`` (OMPL refuses numpy's)."""

    def __init__(self, world: CollisionWorld, constraint: PathConstraint | None) -> None:
        self._is_free = world.is_free
        self._constraint = constraint
        self.checks = 0

    def __call__(self, positions: NDArray[np.float64]) -> bool:
        if self._constraint is not None and not self._constraint.satisfied(positions):
            return False
        self.checks += 1
        return bool(self._is_free(positions))


@contextmanager
def _quiet_ompl() -> Iterator[None]:
    """OMPL's messages off within the block (it warns about every seed but the first)."""
    level = util.getLogLevel()
    util.setLogLevel(util.LOG_NONE)
    try:
        yield
    finally:
        util.setLogLevel(level)


def _state(information: base.SpaceInformation, positions: NDArray[np.float64]) -> base.State:
    state = information.allocState()
    for i, value in enumerate(positions):
        state[i] = float(value)
    return state
