"""Motion planning by BIT*, from OMPL.

Gammell, Srinivasa and Barfoot, "Batch Informed Trees (BIT*)", ICRA 2015.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from ompl import geometric

from bestman_bt.manipulation.motion_planning.ompl_search import ompl_search
from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingParameters, SamplingPlanner
from bestman_bt.manipulation.motion_planning.validity import CountedValidity


@dataclass(frozen=True)
class BITStarParameters(SamplingParameters):
    """The fields of all sampling planners; an attempt always uses ``max_checks``, the more the shorter the path."""

    max_checks: int = 10_000
    max_iterations: int = 1_000_000
    attempts: int = 4


class BITStar(SamplingPlanner):
    """Batches of samples, searched in the order of the solution that they could give."""

    def __init__(self, parameters: BITStarParameters | None = None) -> None:
        self.parameters: BITStarParameters = parameters or BITStarParameters()

    def search(self, query: PlanningQuery, validity: CountedValidity, seed: int) -> NDArray[np.float64] | None:
        """See the base class."""
        p = self.parameters
        return ompl_search(query, validity, seed, geometric.BITstar, p.check_step, p.max_checks, p.max_iterations)
