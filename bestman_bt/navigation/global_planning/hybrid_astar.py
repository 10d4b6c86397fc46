"""Hybrid A* (Dolgov, Thrun, Montemerlo and Diebel, IJRR 2010), for bases that cannot turn in place.

States are poses; the grid only decides which are equivalent. Branches are arcs of the turning radius and straight
pieces, forwards and backwards, checked by footprint. Two heuristics guide the search: the cheapest path over the cells
for any heading, and the Reeds-Shepp curve without obstacles, which is periodically also tried as the rest of the path.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from ompl import base
from typing_extensions import override

from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count, NonNegative, Positive, Several
from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, with_overhang_reason
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.grid_search import costs_to
from bestman_bt.navigation.global_planning.straight_ends import StraightEnds, StraightPieces

# Reeds-Shepp curves: the shortest ways of a car that may drive backwards, from OMPL.
# Reeds and Shepp, "Optimal paths for a car that goes both forwards and backwards", Pacific J. of Mathematics 1990.


_WORLD = 1e4  # metres each way: more than any map


class ReedsShepp:
    """Curves between poses (x, y, theta) with a smallest ``turning_radius``, metres."""

    def __init__(self, turning_radius: float) -> None:
        self._space = base.ReedsSheppStateSpace(turning_radius)
        bounds = base.RealVectorBounds(2)
        bounds.setLow(-_WORLD)
        bounds.setHigh(_WORLD)
        self._space.setBounds(bounds)
        self._from, self._to, self._between = (self._space.allocState() for _ in range(3))

    def length(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> float:
        """Return the length of the shortest curve between two poses (3,), metres."""
        _set(self._from, start)
        _set(self._to, goal)
        return float(self._space.distance(self._from, self._to))

    def poses(self, start: NDArray[np.float64], goal: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
        """Return poses (N, 3), x, y, theta, along the shortest curve, at most ``spacing`` metres apart, both ends
        included.
        """
        count = max(1, math.ceil(self.length(start, goal) / spacing))
        poses = np.empty((count + 1, 3))
        for index in range(count + 1):
            self._space.interpolate(self._from, self._to, index / count, self._between)
            poses[index] = self._between.getX(), self._between.getY(), self._between.getYaw()
        return poses


def _set(state: base.State, pose: NDArray[np.float64]) -> None:
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    # A half turn is out of OMPL's bounds.
    state.setYaw(min(max(float(wrap_angle(pose[2])), -math.pi), math.pi - 1e-12))


_SPACING = 0.025  # metres between poses that are checked and told
CURVE_EVERY = 4
"""Expansions between two attempts of a curve to the goal, the only test of arrival."""


@dataclass(frozen=True, eq=False)
class SearchNode:
    """A node of the search. ``poses``: (N, 3), from the last pose of the parent on; ``backwards``: driving direction;
    ``cost``: from the start."""

    poses: NDArray[np.float64]
    backwards: bool
    cost: float
    parent: SearchNode | None = None


@dataclass(frozen=True)
class HybridAStar(StraightPieces, GlobalPlanner):
    """Plans curves of limited turning radius, forwards and backwards; deterministic.

    ``turning_radius``: minimum radius of curves, metres. ``branch``: length of a curve segment, metres. ``headings``:
    number of discrete headings of states. ``reverse_cost``: factor on metres driven backwards; ``switch_cost``: metres
    of detour worth one change of direction. ``clearance``: metres around the footprint between the ends.
    ``max_expansions``: number of expanded states after which the search fails.
    """

    turning_radius: Annotated[Positive, "m"] = 0.4
    branch: Annotated[Positive, "m"] = 0.2
    headings: Several = 72
    reverse_cost: Positive = 2.0
    switch_cost: Annotated[NonNegative, "m"] = 0.5
    clearance: Annotated[NonNegative, "m"] = 0.01
    max_expansions: Count = 30_000

    @override
    def plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        return with_overhang_reason(self._plan, start, goal, costmap)

    def _plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        ends = StraightEnds(costmap, self, clearance=self.clearance).between(start, goal)
        if isinstance(ends, PlanningFailure):
            return ends
        exit_point, backwards, approach = ends
        root = SearchNode(np.array([[*start.xy, start.theta], [*exit_point, start.theta]]), backwards, 0.0)
        last = HybridAStarSearch(costmap, np.array([*approach, goal.theta]), self).run(root)
        if last is None:
            return PlanningFailure.no_path(start, goal)
        entry = SearchNode(np.array([[*approach, goal.theta], [*goal.xy, goal.theta]]), False, 0.0)
        return _path([*_branches(last), entry], goal)


@dataclass
class HybridAStarSearch:
    """One search by ``planner`` for the pose ``goal``."""

    costmap: Costmap
    goal: NDArray[np.float64]
    planner: HybridAStar
    curves: ReedsShepp = field(init=False)
    left: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        p, costmap = self.planner, self.costmap
        self.curves = ReedsShepp(p.turning_radius)
        self.left = costs_to(self.goal[:2], costmap.for_passing, costmap.footprint.inscribed_radius)
        angles = [k * p.branch / p.turning_radius for k in (-1.0, 0.0, 1.0)]
        self._arcs = np.array([[_arc(angle, sense * p.branch) for angle in angles] for sense in (1.0, -1.0)])

    def run(self, root: SearchNode) -> SearchNode | None:
        """Return the last node of a path to the goal, or None if there is none."""
        p = self.planner
        closed: set[tuple[int, int, int]] = set()
        queue = [(self._estimate(root.poses[-1]), 0, root)]
        pushed, until_curve = 0, 0
        while queue and len(closed) < p.max_expansions:
            total, _, node = heapq.heappop(queue)
            state = self._state(node.poses[-1])
            if not math.isfinite(total) or state in closed:
                continue
            closed.add(state)
            until_curve -= 1
            if until_curve <= 0:
                end = self._curve(node)
                if end is not None:
                    return end
                until_curve = CURVE_EVERY
            for branch in self.successors(node):
                if self._state(branch.poses[-1]) not in closed:
                    pushed += 1
                    heapq.heappush(queue, (branch.cost + self._estimate(branch.poses[-1]), pushed, branch))
        return None

    def successors(self, node: SearchNode) -> list[SearchNode]:
        """Return the free branches that leave ``node``, three forwards and three backwards at most."""
        x, y, theta = node.poses[-1]
        cos, sin = math.cos(theta), math.sin(theta)
        along, aside, turned = np.moveaxis(self._arcs, -1, 0)
        poses = np.stack([x + cos * along - sin * aside, y + sin * along + cos * aside, theta + turned], axis=-1)
        costs = self._costs(poses)
        return [
            self._node(node, poses[back, turn], bool(back), costs[back, turn])
            for back in range(2)
            for turn in range(3)
            if np.isfinite(costs[back, turn])
        ]

    def _node(self, parent: SearchNode, poses: NDArray[np.float64], backwards: bool, cost: float) -> SearchNode:
        driven = cost * (self.planner.reverse_cost if backwards else 1.0)
        switched = self.planner.switch_cost if backwards != parent.backwards and parent.parent is not None else 0.0
        return SearchNode(poses, backwards, parent.cost + driven + switched, parent)

    def _curve(self, node: SearchNode) -> SearchNode | None:
        """Return the Reeds-Shepp curve to the goal as branches, one for each direction, or None if it touches
        something.
        """
        poses = self.curves.poses(node.poses[-1], self.goal, _SPACING)
        if not np.isfinite(self._costs(poses)):
            return None
        moves = np.diff(poses[:, :2], axis=0)
        back = (moves * np.column_stack([np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])])).sum(axis=1) < 0.0
        turns = np.flatnonzero(np.diff(back)) + 1
        for piece in np.split(np.arange(len(moves)), turns):
            if len(piece):
                part = poses[piece[0] : piece[-1] + 2]
                node = self._node(node, part, bool(back[piece[0]]), float(self._costs(part)))
        return node

    def _costs(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cost (...) of driving along poses (..., N, 3); infinite where the footprint has
        too little room.
        """
        footprint, room = self.costmap.footprint, self.planner.clearance
        passing, turning = self.costmap.for_passing, self.costmap.for_turning
        distance = passing.distance_at(poses[..., :2])
        cost = self.costmap.cost(distance, footprint.inscribed_radius)
        outer = distance if turning is passing else turning.distance_at(poses[..., :2])
        near = np.isfinite(cost) & (outer < footprint.circumscribed_radius + room)
        if near.any():
            cost[near] = np.where(self.costmap.footprint_clearance(poses[near]) < room, np.inf, cost[near])
        lengths = np.linalg.norm(np.diff(poses[..., :2], axis=-2), axis=-1).sum(axis=-1)
        total: NDArray[np.float64] = cost.mean(axis=-1) * lengths
        return total

    def _estimate(self, pose: NDArray[np.float64]) -> float:
        return max(float(self.left[self.costmap.cells(pose[:2])]), self.curves.length(pose, self.goal))

    def _state(self, pose: NDArray[np.float64]) -> tuple[int, int, int]:
        row, column = self.costmap.cells(pose[:2])
        headings = self.planner.headings
        return int(row) // 2, int(column) // 2, round(float(pose[2]) / (2.0 * math.pi) * headings) % headings


def _arc(angle: float, length: float) -> NDArray[np.float64]:
    """Return poses (N, 3) along an arc from (0, 0, 0), itself included, that turns by ``angle`` over
    ``length`` metres.
    """
    share = np.linspace(0.0, 1.0, math.ceil(abs(length) / _SPACING) + 1)
    turned = share * math.copysign(angle, angle * length) if angle else np.zeros_like(share)
    if not angle:
        return np.column_stack([share * length, turned, turned])
    radius = length / turned[-1]
    return np.column_stack([radius * np.sin(turned), radius * (1.0 - np.cos(turned)), turned])


def _branches(last: SearchNode) -> list[SearchNode]:
    node: SearchNode | None = last
    branches = []
    while node is not None:
        branches.append(node)
        node = node.parent
    return branches[::-1]


def _path(branches: list[SearchNode], goal: Pose2D) -> Path2D:
    """Return the branches' places without repeated ones."""
    points, reverse = [branches[0].poses[0, :2]], []
    for branch in branches:
        for point in branch.poses[1:, :2]:
            if np.linalg.norm(point - points[-1]) > 1e-6:
                points.append(point)
                reverse.append(branch.backwards)
    return Path2D(np.array(points), goal, np.array(reverse, dtype=bool))
