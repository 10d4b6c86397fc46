"""Planners of OMPL, each with suitable limits.

Sucan, Moll and Kavraki, "The Open Motion Planning Library", IEEE Robotics & Automation Magazine 2012.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric, util
from typing_extensions import override

from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges, CountedValidity
from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingPlanner
from bestman_bt.messages.shapes import Count


def ompl_search(
    query: PlanningQuery,
    validity: CountedValidity,
    seed: int,
    kind: Callable[[base.SpaceInformation], Any],
    longest: float | None,
    check_step: float,
    max_checks: int,
    max_iterations: int,
) -> NDArray[np.float64] | None:
    """Return a path (N, n) from the start to one of the goals, or None without an exact solution.

    ``kind``: of planner; ``longest``: rad, of a branch, None: the planner's default. ``check_step``: rad between
    checked points. The search ends at a solution (optimising planners continue), after ``max_checks`` collision checks
    or ``max_iterations`` iterations.
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
        planner = kind(information)
        if longest is not None:
            planner.setRange(min(longest, space.getMaximumExtent()))
        setup.setPlanner(planner)
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
    """Suppress OMPL's messages within the block (it warns about every seed but the first)."""
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


KINDS: dict[str, Callable[[base.SpaceInformation], Any]] = {
    "aorrtc": geometric.AORRTC,
    "bit_star": geometric.BITstar,
    "kpiece": geometric.LBKPIECE1,  # took a fifth of the checks of the one-tree KPIECE and more
    "rrt_star": geometric.RRTstar,
}


@dataclass(frozen=True)
class OmplPlanner(SamplingPlanner):
    """A planner of OMPL, with one search of at most ``max_checks`` per attempt.

    All but KPIECE use all of these checks; more checks give shorter paths. ``planner``: OMPL's planner. ``aorrtc``:
    repeated RRT-Connect, each time for a cost below the best path so far. ``bit_star``: batches of samples, searched in
    the order of the solution that they could give. ``kpiece``: two trees over a coarse grid of projections, grown where
    it is least explored; edges are checked at the end. ``rrt_star``: one tree, rewired as it grows, so that paths get
    shorter; slow for goals that are hard to reach.
    """

    planner: Literal["aorrtc", "bit_star", "kpiece", "rrt_star"] = field(kw_only=True)
    max_iterations: Count = 1_000_000

    @property
    @override
    def name(self) -> str:
        return self.planner

    def search(self, query: PlanningQuery, edges: CheckedEdges, seed: int) -> NDArray[np.float64] | None:
        """Implement ``SamplingPlanner.search``."""
        # With OMPL's own range RRT* did not reach the shelf in 40,000 checks.
        longest = math.inf if self.planner == "rrt_star" else None
        counts = self.check_step, self.max_checks, self.max_iterations
        return ompl_search(query, edges.is_valid, seed, KINDS[self.planner], longest, *counts)


AORRTC = OmplPlanner(planner="aorrtc", max_checks=6_000, attempts=5)
"""Wilson, Thomason, Kingston, Kavraki and Gammell, "Nearly-optimal bidirectional planning: AORRTC", 2025."""
BIT_STAR = OmplPlanner(planner="bit_star", max_checks=10_000, attempts=4)
"""Gammell, Srinivasa and Barfoot, "Batch Informed Trees (BIT*)", ICRA 2015."""
KPIECE = OmplPlanner(planner="kpiece", max_checks=20_000, attempts=3)
"""Sucan and Kavraki, "Kinodynamic motion planning by interior-exterior cell exploration", WAFR 2008."""
RRT_STAR = OmplPlanner(planner="rrt_star", max_checks=20_000, attempts=3)
"""Karaman and Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 2011."""
