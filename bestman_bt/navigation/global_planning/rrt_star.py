"""RRT*, a tree that is rewired as it grows: k-nearest RRT* of Karaman and Frazzoli (IJRR 2011), with cost.

Our own and not OMPL's, which asks Python about one motion after the other: it took 3 s where this takes 0.5 s, and
seldom came through doorways, as it draws its samples itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.bounds import Count, Positive, Share, WholeNumber
from bestman_bt.navigation.global_planning.polyline_planner import PolylinePlanner
from bestman_bt.navigation.global_planning.room import Room
from bestman_bt.navigation.global_planning.turning_places import turning_places


@dataclass(frozen=True)
class RRTStar(PolylinePlanner):
    """Places where the base can turn, joined where its footprint passes straight; equal seeds give equal paths.

    ``samples``: points that the tree grows towards, the more the shorter the path; ``near_obstacles``: the share that
    is drawn there. ``longest``: metres of a branch. ``goal_every``: until the goal is reached, the tree grows towards
    it each time after so many samples. ``seed``: of the samples.
    """

    samples: Count = 1500
    near_obstacles: Share = 0.5
    longest: Annotated[Positive, "m"] = 2.0
    goal_every: Count = 15
    seed: WholeNumber = 0

    TURNS_EVERYWHERE = (False,)

    def way(self, start: NDArray[np.float64], goal: NDArray[np.float64], room: Room) -> NDArray[np.float64] | None:
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
    def __init__(self, root: NDArray[np.float64], size: int, room: Room, planner: RRTStar) -> None:
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
