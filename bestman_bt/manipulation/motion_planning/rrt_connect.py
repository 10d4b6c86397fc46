"""Motion planning by RRT-Connect, from OMPL.

Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric

from bestman_bt.manipulation.motion_planning.ompl_search import ompl_search
from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingParameters, SamplingPlanner
from bestman_bt.manipulation.motion_planning.validity import CountedValidity


@dataclass(frozen=True)
class RRTConnectParameters(SamplingParameters):
    """Beside the fields of all sampling planners:

    ``short_range``: rad, the longest branch of a first search, which keeps paths short; ``short_checks``: collision
    checks that it may take. Then branches may be of any length, which finds the way through narrow places.
    """

    max_checks: int = 10_000
    attempts: int = 12
    short_range: Annotated[float, "rad"] = 0.7
    short_checks: int = 1500


class RRTConnect(SamplingPlanner):
    """Two trees that grow towards each other: first with short branches, then with long ones."""

    def __init__(self, parameters: RRTConnectParameters | None = None) -> None:
        self.parameters: RRTConnectParameters = parameters or RRTConnectParameters()

    def search(self, query: PlanningQuery, validity: CountedValidity, seed: int) -> NDArray[np.float64] | None:
        """See the base class."""
        parameters = self.parameters
        extent = float(np.linalg.norm(query.upper - query.lower))
        stages = ((parameters.short_range, min(parameters.short_checks, parameters.max_checks)), (math.inf, 0))
        before = validity.checks
        for longest, checks in stages:
            left = parameters.max_checks - (validity.checks - before)

            def make(information: base.SpaceInformation, longest: float = longest) -> base.Planner:
                planner = geometric.RRTConnect(information)
                planner.setRange(min(longest, extent))
                return planner

            if left > 0:
                found = ompl_search(
                    query, validity, seed, make, parameters.check_step, checks or left, parameters.max_iterations
                )
                if found is not None:
                    return found
        return None
