"""Motion planning by KPIECE, from OMPL.

Sucan and Kavraki, "Kinodynamic motion planning by interior-exterior cell exploration", WAFR 2008; here its lazy
bidirectional variant (LBKPIECE), which took a fifth of the checks of the one-tree KPIECE and more.
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
class KPIECEParameters(SamplingParameters):
    """The fields of all sampling planners."""

    max_checks: int = 20_000
    max_iterations: int = 1_000_000
    attempts: int = 3


class KPIECE(SamplingPlanner):
    """Two trees over a coarse grid of projections, grown where it is least explored; edges are checked at the end."""

    def __init__(self, parameters: KPIECEParameters | None = None) -> None:
        self.parameters: KPIECEParameters = parameters or KPIECEParameters()

    def search(self, query: PlanningQuery, validity: CountedValidity, seed: int) -> NDArray[np.float64] | None:
        """See the base class."""
        p = self.parameters
        return ompl_search(query, validity, seed, geometric.LBKPIECE1, p.check_step, p.max_checks, p.max_iterations)
