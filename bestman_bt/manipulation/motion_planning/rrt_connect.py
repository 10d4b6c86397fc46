"""RRT-Connect: two trees that grow towards each other, the smaller one first.

Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000; balanced trees as in
Thomason, Kingston and Kavraki, "Motions in microseconds via vectorized sampling-based planning", ICRA 2024.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges
from bestman_bt.manipulation.motion_planning.query import PlanningQuery
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingPlanner
from bestman_bt.messages.shapes import Count, Positive

_SAMPLES = 256
"""Number of samples drawn in one call."""


class _Tree:
    """Configurations (N, n), each with the number of its parent; -1 of a root.

    ``blocked``: those from which a way was found blocked.
    """

    def __init__(self, roots: Sequence[NDArray[np.float64]]) -> None:
        self._points = np.empty((_SAMPLES, len(roots[0])))
        self._parents: list[int] = []
        self.blocked: set[int] = set()
        for root in roots:
            self.add(root, -1)

    def __len__(self) -> int:
        return len(self._parents)

    def __getitem__(self, index: int) -> NDArray[np.float64]:
        point: NDArray[np.float64] = self._points[index]
        return point

    def add(self, point: NDArray[np.float64], parent: int) -> int:
        if len(self) == len(self._points):
            self._points = np.concatenate([self._points, np.empty_like(self._points)])
        self._points[len(self)] = point
        self._parents.append(parent)
        return len(self) - 1

    def nearest(self, point: NDArray[np.float64]) -> tuple[int, float]:
        """Return index and distance of the nearest configuration."""
        apart = self._points[: len(self)] - point
        squared = np.einsum("ij,ij->i", apart, apart)
        index = int(squared.argmin())
        return index, math.sqrt(squared[index])

    def way_to_root(self, index: int) -> list[NDArray[np.float64]]:
        way = []
        while index >= 0:
            way.append(self._points[index])
            index = self._parents[index]
        return way


@dataclass(frozen=True)
class RRTConnect(SamplingPlanner):
    """Two trees that grow towards each other, the smaller one first.

    Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000. Balanced trees
    (Thomason et al., ICRA 2024) escape from cages with a quarter of the checks of OMPL's version.

    ``longest``: rad, of a branch. ``reach``: rad; from a node that was blocked once, more distant samples are skipped:
    Yershova et al., "Dynamic-domain RRTs", ICRA 2005.
    """

    check_step: Annotated[Positive, "rad"] = 0.04
    max_checks: Count = 20_000
    attempts: Count = 6
    longest: Annotated[Positive, "rad"] = 1.0
    reach: Annotated[Positive, "rad"] = 4.0

    def search(self, query: PlanningQuery, edges: CheckedEdges, seed: int) -> NDArray[np.float64] | None:
        """Implement ``SamplingPlanner.search``."""
        rng = np.random.default_rng(seed)
        trees = [_Tree([query.start]), _Tree(query.goals)]
        end = edges.checks + self.max_checks
        for iteration in range(self.max_iterations):
            if edges.checks > end:
                return None
            if iteration % _SAMPLES == 0:
                samples = rng.uniform(query.lower, query.upper, (_SAMPLES, len(query.start)))
            which = int(len(trees[1]) < len(trees[0])) if len(trees[0]) != len(trees[1]) else iteration % 2
            grown, other = trees[which], trees[1 - which]
            added = self._extend(grown, samples[iteration % _SAMPLES], edges)
            if added is None:
                continue
            met = self._connect(other, grown[added], edges)
            if met is None:
                continue
            way = np.array(grown.way_to_root(added)[::-1] + other.way_to_root(met))
            return way[::-1].copy() if which else way
        return None

    def _extend(self, tree: _Tree, target: NDArray[np.float64], edges: CheckedEdges) -> int | None:
        """Return the number of a new configuration towards ``target``, None if the way there is blocked."""
        index, distance = tree.nearest(target)
        if distance > self.reach and index in tree.blocked:
            return None
        near = tree[index]
        point = target if distance <= self.longest else near + (self.longest / distance) * (target - near)
        if edges.is_free(near, point):
            return tree.add(point, index)
        tree.blocked.add(index)
        return None

    def _connect(self, tree: _Tree, target: NDArray[np.float64], edges: CheckedEdges) -> int | None:
        """Grow ``tree`` straight towards ``target``: number of its last configuration before it, or None if blocked."""
        index, distance = tree.nearest(target)
        count = max(1, math.ceil(distance / self.longest))
        near = tree[index]
        for i in range(1, count + 1):
            point = target if i == count else near + (i / count) * (target - near)
            if not edges.is_free(tree[index], point):
                return None
            if i < count:
                index = tree.add(point, index)
        return index
