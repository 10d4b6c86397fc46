"""Motion planning on a probabilistic roadmap whose edges are checked only where a shortest path wants them.

Kavraki et al., "Probabilistic roadmaps for path planning in high-dimensional configuration spaces", 1996;
Bohlin and Kavraki, "Path planning using lazy PRM", ICRA 2000. OMPL's PRM decides in a second thread, by the clock, when
it is done, and checks every edge; this one is repeatable, and a roadmap of a thousand postures costs a few checks more
than a thousand.

Chosen by ``algorithms: {motion_planning: {algorithm: "examples/plugins/lazy_prm.py:PRM"}}``;
``docs/manipulation.md`` has its figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges, CountedValidity
from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingPlanner
from bestman_bt.messages.shapes import Count


@dataclass(frozen=True)
class PRM(SamplingPlanner):
    """A roadmap per question, and the shortest path on it; blocked edges leave it.

    ``samples``: valid postures in a roadmap. ``neighbours``: edges per posture. ``max_iterations``: of shortest paths.
    """

    max_checks: Count = 30_000
    max_iterations: Count = 2_000
    attempts: Count = 3
    samples: Count = 1500
    neighbours: Count = 15

    def search(self, query: PlanningQuery, edges: CheckedEdges, seed: int) -> NDArray[np.float64] | None:
        """See the base class."""
        validity = edges.is_valid
        last_check = validity.checks + self.max_checks
        rng = np.random.default_rng(seed)
        nodes = self._nodes(query, validity, rng, last_check)
        weights = _neighbours(nodes, self.neighbours)
        goals = np.arange(1, len(query.goals) + 1)
        for _ in range(self.max_iterations):
            route = _shortest(weights, goals)
            if route is None or validity.checks > last_check:
                return None
            # From the ends inwards: near start and goal the free space is narrowest.
            steps = list(pairwise(route))
            steps.sort(key=lambda step: min(route.index(step[0]), len(route) - route.index(step[1])))
            blocked = next(((i, j) for i, j in steps if not edges.is_free(nodes[min(i, j)], nodes[max(i, j)])), None)
            if blocked is None:
                path: NDArray[np.float64] = nodes[route]
                return path
            weights[blocked], weights[blocked[::-1]] = np.inf, np.inf
        return None

    def _nodes(
        self, query: PlanningQuery, validity: CountedValidity, rng: np.random.Generator, last_check: int
    ) -> NDArray[np.float64]:
        """(N, n): the start, the goals, then valid samples."""
        nodes = [query.start, *query.goals]
        wanted = len(nodes) + self.samples
        while len(nodes) < wanted and validity.checks < last_check:
            sample = rng.uniform(query.lower, query.upper)
            if validity(sample):
                nodes.append(sample)
        return np.array(nodes)


def _neighbours(nodes: NDArray[np.float64], count: int) -> csr_matrix:
    """Symmetric distances (N, N) of each node to its nearest ``count``, radians."""
    distances, others = cKDTree(nodes).query(nodes, k=min(count + 1, len(nodes)))
    rows = np.repeat(np.arange(len(nodes)), distances.shape[1])
    graph = csr_matrix((distances.ravel(), (rows, others.ravel())), shape=(len(nodes), len(nodes)))
    graph.setdiag(0.0)
    graph.eliminate_zeros()
    return graph.maximum(graph.T).tocsr()


def _shortest(weights: csr_matrix, goals: NDArray[np.intp]) -> list[int] | None:
    """Nodes from node 0 to the nearest of ``goals``; None where none is connected."""
    distances, before = dijkstra(weights, indices=0, return_predecessors=True)
    goal = int(goals[np.argmin(distances[goals])])
    if not np.isfinite(distances[goal]):
        return None
    route = [goal]
    while route[-1] != 0:
        route.append(int(before[route[-1]]))
    return route[::-1]
