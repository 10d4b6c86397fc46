"""One search by a planner of OMPL: exact solutions only, seeded, ended by counts.

Sucan, Moll and Kavraki, "The Open Motion Planning Library", IEEE Robotics & Automation Magazine 2012.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric, util

from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.validity import CountedValidity


def ompl_search(
    query: PlanningQuery,
    validity: CountedValidity,
    seed: int,
    make_planner: Callable[[base.SpaceInformation], base.Planner],
    check_step: float,
    max_checks: int,
    max_iterations: int,
) -> NDArray[np.float64] | None:
    """A path (N, n) from the start to one of the goals; None if the search ended without an exact solution.

    ``check_step``: rad between checked points. The search ends at a solution (planners that improve theirs go on),
    after ``max_checks`` collision checks or ``max_iterations`` iterations.
    """
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
        information.setStateValidityCheckingResolution(check_step / space.getMaximumExtent())
        setup.addStartState(_state(information, query.start))
        targets = base.GoalStates(information)
        for goal in query.goals:
            targets.addState(_state(information, goal))
        setup.setGoal(targets)
        setup.setPlanner(make_planner(information))
        setup.solve(base.PlannerTerminationCondition(_limit(validity, max_checks, max_iterations)))
        # An "approximate" solution is truthy too: only an exact one counts.
        if not setup.haveExactSolutionPath():
            return None
        path = np.array([state[0:count] for state in setup.getSolutionPath().getStates()])
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9
    kept: NDArray[np.float64] = path[np.concatenate([[True], steps])]
    return kept


def _limit(validity: CountedValidity, max_checks: int, max_iterations: int) -> Callable[[], bool]:
    last_check = validity.checks + max_checks
    iterations = 0

    def is_over() -> bool:
        nonlocal iterations
        iterations += 1
        return iterations > max_iterations or validity.checks > last_check

    return is_over


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
