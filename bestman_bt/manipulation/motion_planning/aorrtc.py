"""Motion planning by AORRTC, from OMPL.

Wilson, Thomason, Kingston, Kavraki and Gammell, "Nearly-optimal bidirectional planning: AORRTC", 2025.
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
class AORRTCParameters(SamplingParameters):
    """The fields of all sampling planners; an attempt always uses ``max_checks``, the more the shorter the path."""

    max_checks: int = 6_000
    max_iterations: int = 1_000_000
    attempts: int = 5


class AORRTC(SamplingPlanner):
    """RRT-Connect again and again, each time for less than the best path so far."""

    def __init__(self, parameters: AORRTCParameters | None = None) -> None:
        self.parameters: AORRTCParameters = parameters or AORRTCParameters()

    def search(self, query: PlanningQuery, validity: CountedValidity, seed: int) -> NDArray[np.float64] | None:
        """See the base class."""
        p = self.parameters
        return ompl_search(query, validity, seed, geometric.AORRTC, p.check_step, p.max_checks, p.max_iterations)
