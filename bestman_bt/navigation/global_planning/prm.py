"""PRM, a probabilistic roadmap (Kavraki, Svestka, Latombe and Overmars 1996), drawn anew for each plan.

Our own and not OMPL's, which asks a second thread whether it is done, so that equal seeds have unequal roadmaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from bestman_bt.messages.bounds import Count, Positive, Share, WholeNumber
from bestman_bt.navigation.global_planning.polyline_planner import PolylinePlanner
from bestman_bt.navigation.global_planning.room import Room
from bestman_bt.navigation.global_planning.turning_places import turning_places


@dataclass(frozen=True)
class PRM(PolylinePlanner):
    """Places where the base can turn, joined where its footprint passes straight; equal seeds give equal paths.

    ``samples``: places in the roadmap; ``near_obstacles``: the share of them that is drawn there. ``neighbours``: to
    how many of the nearest ones each is joined, if nothing is in between, and to how many of all others within
    ``longest`` metres at most: narrow places are passed from afar. ``seed``: of the samples.
    """

    samples: Count = 1000
    near_obstacles: Share = 0.7
    neighbours: Count = 10
    longest: Annotated[Positive, "m"] = 2.5
    seed: WholeNumber = 0

    TURNS_EVERYWHERE = (False,)

    def way(self, start: NDArray[np.float64], goal: NDArray[np.float64], room: Room) -> NDArray[np.float64] | None:
        """See the base class."""
        rng = np.random.default_rng(self.seed)
        places = np.vstack([start, goal, turning_places(room, self.samples, self.near_obstacles, rng)])
        pairs = self._pairs(places, rng)
        costs = room.segment_costs(places[pairs[:, 0]], places[pairs[:, 1]]) + self.turn_cost
        free = np.isfinite(costs)
        roadmap = csr_matrix((costs[free], (pairs[free, 0], pairs[free, 1])), shape=(len(places), len(places)))
        reached, previous = dijkstra(roadmap, directed=False, indices=0, return_predecessors=True)
        if not np.isfinite(reached[1]):
            return None
        way = [1]
        while way[-1] != 0:
            way.append(int(previous[way[-1]]))
        points: NDArray[np.float64] = places[way[::-1]]
        return points

    def _pairs(self, places: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.intp]:
        """Which places (N, 2) to join, (M, 2) indices."""
        count = min(self.neighbours + 1, len(places))
        _, nearest = cKDTree(places).query(places, count)
        others = rng.integers(len(places), size=(len(places), count))
        each = np.arange(len(places))[:, None]
        far = np.linalg.norm(places[others] - places[each], axis=-1) > self.longest
        others[far] = np.broadcast_to(each, others.shape)[far]
        partners = np.column_stack([nearest, others])
        pairs = np.column_stack([np.repeat(each, partners.shape[1]), partners.ravel()])
        return np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
