"""Base of planners of polylines, for bases that turn in place at the corners.

Both ends are checked by footprint: the start is left straight, backwards or forwards, to a place where the base can
turn, and the goal is entered straight along its heading from such a place; if there is none, as in a narrow hallway,
hybrid A* searches a curved path. In between, places where the base can turn freely are tried first, and narrower ones,
which are passed straight, only if there is no other path.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import NonNegative, Several
from bestman_bt.navigation.global_planning.base import (
    GlobalPlanner,
    PlanningFailure,
    PlanningFailureReason,
    with_overhang_reason,
)
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.grid_search import cheapest_path
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar
from bestman_bt.navigation.global_planning.straight_ends import StraightEnds, StraightPieces

_ASIDE = (0.0, 1.0, 0.5, 1.5)
"""Lateral offsets at which the base tries to pass narrow places, in this order, as fractions of the lateral offset of
the overhang's centre. Paths over cells are rarely in the middle of a gap themselves.
"""
NO_ROOM_TO_TURN = frozenset((PlanningFailureReason.START_BLOCKED, PlanningFailureReason.GOAL_BLOCKED))
"""Message for an end without room to turn, or where the base collides."""
ARRIVED = 0.02
ALMOST_ALONG, SMALL_TURN = 0.1, 0.3
"""Metres within which a base counts as on a line; and radians by which a base may turn even if it has no room for a
full turn.
"""
_AHEAD = 4
"""Number of path points over which its direction is measured."""


@dataclass(frozen=True)
class PolylinePlanner(StraightPieces, GlobalPlanner):
    """Ends by footprint, a path between them from the subclass, then the cheapest polyline through its points.

    ``turning_clearance``: metres beyond the turning radius where the base turns. ``slack``: reduction of it, metres, at
    the highest cost, in narrow places such as doorways, because cell centres are rarely in the middle of a gap.
    ``turn_cost``: metres of detour worth one corner. ``vertex_limit``: number of path points to consider in the
    smoothing.
    """

    turning_clearance: Annotated[NonNegative, "m"] = 0.02
    slack: Annotated[NonNegative, "m"] = 0.01
    turn_cost: Annotated[NonNegative, "m"] = 0.1
    vertex_limit: Several = 40

    TURNS_EVERYWHERE: ClassVar[tuple[bool, ...]] = (True, False)
    """The kinds of free space to search, in this order."""

    @abstractmethod
    def search_path(
        self, start: NDArray[np.float64], goal: NDArray[np.float64], room: FreeSpace
    ) -> NDArray[np.float64] | None:
        """Return points (N, 2), metres, on a path in ``room`` from near ``start`` (2,) to near ``goal`` (2,), or
        None.
        """

    @override
    def plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        return with_overhang_reason(self._plan, start, goal, costmap)

    def _plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        turning_distance = costmap.footprint.turning_radius + self.turning_clearance
        ends = StraightEnds(costmap, self, turning_distance, self.slack).between(start, goal)
        if isinstance(ends, PlanningFailure):
            return self._without_turning(start, goal, costmap) if ends.reason in NO_ROOM_TO_TURN else ends
        exit_point, backwards, approach = ends
        if self._enters(start, goal, costmap, turning_distance):
            return Path2D(np.array([start.xy, goal.xy]), goal)
        for turns_everywhere in self.TURNS_EVERYWHERE:
            room = FreeSpace(costmap, turning_distance, self.slack, turns_everywhere)
            way = self.search_path(exit_point, approach, room)
            if way is None:
                continue
            shares = (0.0,) if turns_everywhere or costmap.tall is None else _ASIDE
            for aside in (-share * _middle_above(costmap) for share in shares):
                middle = self._polyline(np.vstack([exit_point, _beside(way, aside), approach]), room)
                if middle is not None:
                    points, reverse = _joined(start.xy, middle, goal.xy, backwards)
                    return Path2D(points, goal, reverse)
        return PlanningFailure.no_path(start, goal)

    def _enters(self, start: Pose2D, goal: Pose2D, costmap: Costmap, turning_distance: float) -> bool:
        """Return whether the base is on the straight way into the goal already, and may drive straight on.

        Otherwise repeated planning would return to the start of that path, and, there, turn for ever into
        the direction of a segment of millimetres.
        """
        place, way = goal.inverse() @ start, goal.xy - start.xy
        if not -self.straight - ARRIVED <= place.x < 0.0 or abs(place.y) > min(ARRIVED, -ALMOST_ALONG * place.x):
            return False
        heading = math.atan2(way[1], way[0])
        turns = bool(costmap.for_turning.distance_at(start.xy[None])[0] >= turning_distance)
        if not turns and abs(wrap_angle(start.theta - heading)) > SMALL_TURN:
            return False
        share = np.linspace(0.0, 1.0, 2 + round(float(np.linalg.norm(way)) / self.step))
        on_the_way = np.column_stack([start.xy + share[:, None] * way, np.full_like(share, heading)])
        poses = np.vstack([[*start.xy, start.theta], on_the_way])
        return bool((costmap.footprint_clearance(poses) > 0.0).all())

    def _without_turning(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        """Return a path of curves, for ends without room to turn in place, as in a narrow hallway."""
        curves = HybridAStar(
            straight=self.straight, max_straight=self.max_straight, step=self.step, max_overlap=self.max_overlap
        )
        return curves.plan(start, goal, costmap)

    def _polyline(self, points: NDArray[np.float64], room: FreeSpace) -> NDArray[np.float64] | None:
        """Return the cheapest polyline through some of ``points`` (N, 2) that keeps the first and the last."""
        limit = self.vertex_limit
        if len(points) < limit:
            length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
            points = _densified(points, max(2.0 * room.costmap.resolution, length / (limit - len(points))))
        if not room.turns_everywhere:
            turns = room.can_turn(points)
            turns[[0, -1]] = True
            points = points[turns]
        count = min(len(points), limit)
        kept = np.unique(np.linspace(0, len(points) - 1, count).round().astype(int))
        vertices = points[kept]
        best = np.full(len(vertices), np.inf)
        best[0] = 0.0
        previous = np.zeros(len(vertices), dtype=int)
        # Where even the next vertex cannot be reached straight, the way between the two is taken as it was found.
        as_found = np.zeros(len(vertices), dtype=bool)
        for i in range(len(vertices) - 1):
            so_far = best[i] + self.turn_cost
            # A metre costs 1 or more, so that many segments cannot be worth it.
            hopeful = so_far + np.hypot(*(vertices[i + 1 :] - vertices[i]).T) < best[i + 1 :]
            if not hopeful.any():
                continue
            cost = np.full(len(hopeful), np.inf)
            cost[hopeful] = so_far + room.segment_costs(vertices[i], vertices[i + 1 :][hopeful])
            if room.turns_everywhere and hopeful[0] and not np.isfinite(cost[0]):
                length = np.linalg.norm(np.diff(points[kept[i] : kept[i + 1] + 1], axis=0), axis=1).sum()
                cost[0] = best[i] + 10.0 * length
                as_found[i + 1] = cost[0] < best[i + 1]
            better = cost < best[i + 1 :]
            best[i + 1 :][better] = cost[better]
            previous[i + 1 :][better] = i
        if not np.isfinite(best[-1]):
            return None
        pieces = [points[-1:]]
        j = len(vertices) - 1
        while j != 0:
            i = int(previous[j])
            pieces.append(points[kept[i] : kept[j]] if as_found[j] and i == j - 1 else points[kept[i]][None])
            j = i
        return np.vstack(pieces[::-1])


@dataclass(frozen=True)
class GridAStar(PolylinePlanner):
    """The cheapest path over the cells, 8-connected (Hart, Nilsson and Raphael 1968); deterministic."""

    def search_path(
        self, start: NDArray[np.float64], goal: NDArray[np.float64], room: FreeSpace
    ) -> NDArray[np.float64] | None:
        """Return the points (N, 2) of the cheapest grid path, metres, or None."""
        return cheapest_path(start, goal, room.field, room.lethal_distance, room.lethal_slack)


def _middle_above(costmap: Costmap) -> float:
    """Return the offset, metres to the left of the base's middle, of the middle of the outline of the
    arm and its load.
    """
    return float(np.ptp(costmap.footprint.above.corners[:, 1]) / 2 + costmap.footprint.above.corners[:, 1].min())


def _beside(way: NDArray[np.float64], aside: float) -> NDArray[np.float64]:
    """Return a way (N, 2) so many metres to the left of another, as seen along it."""
    if aside == 0.0 or len(way) < 2:
        return way
    index = np.arange(len(way))
    along = way[np.minimum(index + _AHEAD, len(way) - 1)] - way[np.maximum(index - _AHEAD, 0)]
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    shifted: NDArray[np.float64] = way + aside * left
    return shifted


def _densified(vertices: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return points (N, 2) along a polyline, at least ``spacing`` metres apart, its vertices among them."""
    pieces = [vertices[:1]]
    for begin, end in pairwise(vertices):
        count = max(1, math.floor(float(np.linalg.norm(end - begin)) / spacing))
        pieces.append(begin + (end - begin) * (np.arange(1, count + 1) / count)[:, None])
    return np.vstack(pieces)


def _joined(
    start: NDArray[np.float64], middle: NDArray[np.float64], goal: NDArray[np.float64], backwards: bool
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the whole path without repeated points, and which of its segments are driven backwards."""
    points = np.vstack([start, middle, goal])
    reverse = np.zeros(len(points) - 1, dtype=bool)
    reverse[0] = backwards
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6
    return points[np.append(True, moves)], reverse[moves]


_MANY = 1500  # samples from which on it is worth while to look at a few of them first:
_SPARSE = 8  # one of so many


@dataclass(frozen=True)
class FreeSpace:
    """The free space of a costmap for a base that drives straight and turns in place.

    ``turning_distance``: metres from obstacles at which it can turn, minus ``slack`` if necessary, at the highest cost.
    ``turns_everywhere``: keep that distance along the whole path; otherwise only where the base turns, and in between
    its footprint, aligned with the path, must be free.
    """

    costmap: Costmap
    turning_distance: float
    slack: float
    turns_everywhere: bool

    @property
    def field(self) -> Costmap:
        """The costmap with one field: the base's centre must keep ``lethal_distance``."""
        return self.costmap.for_turning if self.turns_everywhere else self.costmap.for_passing

    @property
    def lethal_distance(self) -> float:
        """Smallest distance of the base's centre from obstacles, metres."""
        return self.turning_distance if self.turns_everywhere else self.costmap.footprint.inscribed_radius

    @property
    def lethal_slack(self) -> float:
        """Reduction of ``lethal_distance`` in narrow places, metres."""
        return self.slack if self.turns_everywhere else 0.0

    def can_turn(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return at which of the points (..., 2) the base can turn to any heading."""
        turns: NDArray[np.bool_] = self.costmap.for_turning.distance_at(points) >= self.turning_distance - self.slack
        return turns

    def segment_costs(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cost (N,) of driving straight from ``starts`` (2,) or (N, 2) to ``ends`` (N, 2); infinite if
        blocked.
        """
        starts = np.broadcast_to(starts, ends.shape)
        field, spacing = self.field, self.costmap.resolution / 2
        costs = np.full(len(ends), np.inf)
        candidates = np.arange(len(ends))
        if np.abs(ends - starts).sum() / spacing > _MANY:
            # Most segments are blocked, and a few of their samples tell.
            points, segments, _ = _samples(starts, ends, _SPARSE * spacing)
            passable = np.ones(len(ends), dtype=bool)
            passable[segments[field.distance_at(points) < self.lethal_distance - self.lethal_slack]] = False
            candidates = np.flatnonzero(passable)
        if len(candidates):
            starts, ends = starts[candidates], ends[candidates]
            points, segments, counts = _samples(starts, ends, spacing)
            distance = field.distance_at(points)
            cost = self.costmap.cost(distance, self.lethal_distance, self.lethal_slack)
            if not self.turns_everywhere:
                headings = np.arctan2(ends[:, 1] - starts[:, 1], ends[:, 0] - starts[:, 0])
                cost[self._touches(points, headings[segments], distance)] = np.inf
            lengths = np.hypot(*(ends - starts).T)
            costs[candidates] = np.add.reduceat(cost, np.cumsum(counts) - counts) / counts * lengths
        return costs

    def _touches(
        self, points: NDArray[np.float64], headings: NDArray[np.float64], distance: NDArray[np.float64]
    ) -> NDArray[np.intp]:
        """Return the indices of the points (N, 2) at which the footprint touches an obstacle."""
        footprint, turning = self.costmap.footprint, self.costmap.for_turning
        outer = distance if turning is self.field else turning.distance_at(points)
        near = np.flatnonzero((distance >= footprint.inscribed_radius) & (outer < footprint.circumscribed_radius))
        clearance = self.costmap.footprint_clearance(np.column_stack([points[near], headings[near]]))
        return near[clearance <= 0.0]


def _samples(
    starts: NDArray[np.float64], ends: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Return points (M, 2) along segments, at most ``spacing`` apart, both ends included; the segment of each; their
    number.
    """
    lengths = np.hypot(*(ends - starts).T)
    counts = np.maximum(2, np.ceil(lengths / spacing)).astype(np.intp) + 1
    segments = np.repeat(np.arange(len(ends)), counts)
    number = np.arange(len(segments)) - (np.cumsum(counts) - counts)[segments]
    share = (number / (counts - 1)[segments])[:, None]
    return starts[segments] + share * (ends - starts)[segments], segments, counts
