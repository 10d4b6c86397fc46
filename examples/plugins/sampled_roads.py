"""Global planners that sample places where the base can turn: PRM and RRT*, both seeded.

PRM: a roadmap drawn anew for each plan (Kavraki, Svestka, Latombe and Overmars 1996). RRT*: a tree that is rewired as
it grows, k-nearest and with cost (Karaman and Frazzoli, IJRR 2011). OMPL's PRM asks a second thread whether it is done,
so that equal seeds have unequal roadmaps; its RRT* took 3 s where this takes 0.5 s, as it asks about one motion after
the other.

Chosen by ``algorithms: {global_planning: {algorithm: "examples/plugins/sampled_roads.py:PRM"}}``, or ``:RRTStar``;
``docs/navigation.md`` has their figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from bestman_bt.messages.shapes import Count, Fraction, NonNegativeInt, Positive
from bestman_bt.navigation.global_planning.polyline_planner import FreeSpace, PolylinePlanner

_NEAR = 0.3
"""Metres beyond the distance at which the base can turn that count as near an obstacle."""


def turning_places(room: FreeSpace, count: int, near_obstacles: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Up to ``count`` points (N, 2), metres; a share of ``near_obstacles`` is drawn near these.

    In doorways samples are rare otherwise (Boor, Overmars and van der Stappen, "The Gaussian sampling strategy for
    probabilistic roadmap planners", ICRA 1999).
    """
    costmap = room.costmap.for_turning
    beyond = costmap.distance - room.turning_distance
    near = round(near_obstacles * count)
    drawn = []
    for free, wanted in ((beyond >= 0.0, count - near), ((beyond >= -room.slack) & (beyond < _NEAR), near)):
        cells = np.argwhere(free)
        if len(cells):
            drawn.append(costmap.grid_points(cells[rng.integers(len(cells), size=wanted)]))
    if not drawn:
        return np.zeros((0, 2))
    points = np.vstack(drawn)
    points += rng.uniform(-0.5, 0.5, points.shape) * costmap.resolution
    places: NDArray[np.float64] = rng.permutation(points[room.can_turn(points)])
    return places


@dataclass(frozen=True)
class RRTStar(PolylinePlanner):
    """Places where the base can turn, joined where its footprint passes straight; equal seeds give equal paths.

    ``samples``: points that the tree grows towards, the more the shorter the path; ``near_obstacles``: the share that
    is drawn there. ``longest``: metres of a branch. ``goal_every``: until the goal is reached, the tree grows towards
    it each time after so many samples. ``seed``: of the samples.
    """

    samples: Count = 1500
    near_obstacles: Fraction = 0.5
    longest: Annotated[Positive, "m"] = 2.0
    goal_every: Count = 15
    seed: NonNegativeInt = 0

    TURNS_EVERYWHERE = (False,)

    def search_path(
        self, start: NDArray[np.float64], goal: NDArray[np.float64], room: FreeSpace
    ) -> NDArray[np.float64] | None:
        """See the base class."""
        samples = turning_places(room, self.samples, self.near_obstacles, np.random.default_rng(self.seed))
        tree = _Tree(start, len(samples) + len(samples) // self.goal_every + 2, room, self)
        reached = tree.grow(goal)
        for number, sample in enumerate(samples, start=1):
            if reached is None or tree.may_shorten(sample, reached):
                tree.grow(sample)
            if number % self.goal_every == 0 and reached is None:
                reached = tree.grow(goal)
        return None if reached is None else tree.branch(reached)


class _Tree:
    def __init__(self, root: NDArray[np.float64], size: int, room: FreeSpace, planner: RRTStar) -> None:
        self._room, self._planner = room, planner
        self._points = np.empty((size, 2))
        self._points[0] = root
        self._costs = np.zeros(size)
        self._parents = [-1]
        self._children: list[list[int]] = [[]]

    def grow(self, sample: NDArray[np.float64]) -> int | None:
        """A new branch towards a sample (2,); the number of the sample's node if the branch ends there."""
        count = len(self._parents)
        away = np.linalg.norm(self._points[:count] - sample, axis=1)
        first = int(np.argmin(away))
        point, complete = sample, away[first] <= self._planner.longest
        if not complete:
            point = self._points[first] + (sample - self._points[first]) * (self._planner.longest / away[first])
            if not self._room.can_turn(point):
                return None
            away = np.linalg.norm(self._points[:count] - point, axis=1)
        # k of the k-nearest RRT* in the plane: e (1 + 1/2) log n.
        nearest = np.argsort(away, kind="stable")[: math.ceil(1.5 * math.e * math.log(count + 1))]
        steps = self._room.segment_costs(self._points[nearest], np.broadcast_to(point, (len(nearest), 2)))
        steps += self._planner.turn_cost
        totals = self._costs[nearest] + steps
        best = int(np.argmin(totals))
        if not math.isfinite(totals[best]):
            return None
        self._points[count], self._costs[count] = point, totals[best]
        self._parents.append(int(nearest[best]))
        self._children.append([])
        self._children[nearest[best]].append(count)
        for node, total in zip(nearest.tolist(), (totals[best] + steps).tolist(), strict=True):
            if total < self._costs[node] - 1e-9:
                self._move(node, count, total)
        return count if complete else None

    def may_shorten(self, sample: NDArray[np.float64], node: int) -> bool:
        """Whether a way to a node by a sample (2,) may be worth it (informed RRT*, Gammell et al. 2014)."""
        ends = self._points[[0, node]]
        return bool(np.linalg.norm(ends - sample, axis=1).sum() < self._costs[node])

    def branch(self, node: int) -> NDArray[np.float64]:
        """Points (N, 2) from the root to a node."""
        way = [node]
        while way[-1] != 0:
            way.append(self._parents[way[-1]])
        points: NDArray[np.float64] = self._points[way[::-1]]
        return points

    def _move(self, node: int, parent: int, cost: float) -> None:
        """Hang a node with all that grows from it on another parent."""
        self._children[self._parents[node]].remove(node)
        self._children[parent].append(node)
        self._parents[node] = parent
        saved, below = self._costs[node] - cost, [node]
        while below:
            moved = below.pop()
            self._costs[moved] -= saved
            below += self._children[moved]


@dataclass(frozen=True)
class PRM(PolylinePlanner):
    """Places where the base can turn, joined where its footprint passes straight; equal seeds give equal paths.

    ``samples``: places in the roadmap; ``near_obstacles``: the share of them that is drawn there. ``neighbours``: to
    how many of the nearest ones each is joined, if nothing is in between, and to how many of all others within
    ``longest`` metres at most: narrow places are passed from afar. ``seed``: of the samples.
    """

    samples: Count = 1000
    near_obstacles: Fraction = 0.7
    neighbours: Count = 10
    longest: Annotated[Positive, "m"] = 2.5
    seed: NonNegativeInt = 0

    TURNS_EVERYWHERE = (False,)

    def search_path(
        self, start: NDArray[np.float64], goal: NDArray[np.float64], room: FreeSpace
    ) -> NDArray[np.float64] | None:
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
