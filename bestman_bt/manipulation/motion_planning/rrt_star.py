"""Motion planning by RRT*, from OMPL.

Karaman and Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 2011.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric

from bestman_bt.manipulation.motion_planning.ompl_search import ompl_search
from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingParameters, SamplingPlanner
from bestman_bt.manipulation.motion_planning.validity import CountedValidity


@dataclass(frozen=True)
class RRTStarParameters(SamplingParameters):
    """The fields of all sampling planners; an attempt always uses ``max_checks``, the more the shorter the path."""

    max_checks: int = 20_000
    max_iterations: int = 1_000_000
    attempts: int = 3


class RRTStar(SamplingPlanner):
    """One tree, rewired as it grows, so that paths get shorter: slow where a goal is hard to reach."""

    def __init__(self, parameters: RRTStarParameters | None = None) -> None:
        self.parameters: RRTStarParameters = parameters or RRTStarParameters()

    def search(self, query: PlanningQuery, validity: CountedValidity, seed: int) -> NDArray[np.float64] | None:
        """See the base class."""

        def make(information: base.SpaceInformation) -> base.Planner:
            planner = geometric.RRTstar(information)
            # Branches of any length: with OMPL's own range it did not reach the shelf in 40,000 checks.
            planner.setRange(float(np.linalg.norm(query.upper - query.lower)))
            return planner

        p = self.parameters
        return ompl_search(query, validity, seed, make, p.check_step, p.max_checks, p.max_iterations)
