"""A* on the grid (Hart, Nilsson, Raphael 1968), 8-connected, with cost, then any-angle smoothing.

Near furniture a base may neither turn nor take any direction, so both ends of a path are treated by footprint: the
start is left by backing out straight (or straight ahead) to a place where the base can turn, and the goal is entered
straight along its heading from such a place. In between, places where the base can turn freely are tried first, and
narrower ones, checked by footprint, only when there is no other way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.grid_search import cheapest_way

_SPARSE = 8  # of so many samples of a segment, one is looked at first


@dataclass(frozen=True)
class GridAStarParameters:
    """``turning_clearance``: metres kept beyond the circumscribed radius where the base turns.

    ``slack``: metres less of it, at the highest cost, where there is no more room, as in narrow doorways: cells rarely
    have their centres in the middle of one. ``straight``: wanted, ``max_straight``: longest straight piece to leave a
    start or to enter a goal where the base cannot turn, metres. ``step``: spacing of collision checks along it, metres.
    ``turn_cost``: metres of detour worth one corner. ``max_overlap``: metres by which the base may stand inside a
    margin at the start. ``vertex_limit``: how many points of the grid path the smoothing considers.
    """

    turning_clearance: float = 0.02
    slack: float = 0.01
    straight: float = 0.4
    max_straight: float = 1.2
    step: float = 0.02
    turn_cost: float = 0.1
    max_overlap: float = 0.06
    vertex_limit: int = 40


class GridAStar(GlobalPlanner):
    """A* on the costmap with footprint-aware ends; deterministic."""

    def __init__(self, parameters: GridAStarParameters | None = None) -> None:
        self._parameters = parameters or GridAStarParameters()

    def plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        """See ``GlobalPlanner.plan``."""
        for pose, what, reason in (
            (start, "start", PlanningFailureReason.START_OUTSIDE),
            (goal, "goal", PlanningFailureReason.GOAL_OUTSIDE),
        ):
            if not costmap.contains(pose.xy):
                return PlanningFailure(reason, f"the {what} ({pose.x:.2f}, {pose.y:.2f}) m is not on the map")
        if costmap.clearance_at(goal) <= 0.0:
            return PlanningFailure(
                PlanningFailureReason.GOAL_BLOCKED,
                f"the base would touch an obstacle at the goal ({goal.x:.2f}, {goal.y:.2f}) m, "
                f"{math.degrees(goal.theta):.0f}°",
            )
        turning_distance = costmap.footprint.circumscribed_radius + self._parameters.turning_clearance
        leave = self._leave(start, costmap, turning_distance)
        if leave is None:
            return PlanningFailure(
                PlanningFailureReason.START_BLOCKED,
                f"the base cannot leave ({start.x:.2f}, {start.y:.2f}) m straight back or ahead without touching",
            )
        approach = self._approach(goal, costmap, turning_distance)
        if approach is None:
            return PlanningFailure(
                PlanningFailureReason.GOAL_BLOCKED,
                f"there is no free straight approach to ({goal.x:.2f}, {goal.y:.2f}) m, "
                f"{math.degrees(goal.theta):.0f}°",
            )
        exit_point, backwards = leave
        for lethal_distance, slack in (
            (turning_distance, self._parameters.slack),
            (costmap.footprint.inscribed_radius, 0.0),
        ):
            cells = cheapest_way(exit_point, approach, costmap, lethal_distance, slack)
            if cells is None:
                continue
            middle = self._smooth(np.vstack([exit_point, cells, approach]), costmap, lethal_distance, slack)
            points, reverse = _joined(start.xy, middle, goal.xy, backwards)
            path = Path2D(points, goal, reverse)
            if lethal_distance == turning_distance or self._is_free(middle, costmap):
                return path
        return PlanningFailure(
            PlanningFailureReason.NO_PATH,
            f"nothing wide enough for the base leads from ({start.x:.2f}, {start.y:.2f}) m "
            f"to ({goal.x:.2f}, {goal.y:.2f}) m",
        )

    def _leave(
        self, start: Pose2D, costmap: Costmap, turning_distance: float
    ) -> tuple[NDArray[np.float64], bool] | None:
        """Where the base can turn first, (2,), and whether it drives there backwards."""
        best: tuple[int, NDArray[np.float64], bool] | None = None
        for direction in (-1.0, 1.0):
            poses = self._straight(start, direction)
            clearance = costmap.footprint_clearance(poses)
            # A base that stands inside a margin may leave it as long as it does not come nearer to anything.
            rising = np.append(clearance[0] > -self._parameters.max_overlap, np.diff(clearance) > -1e-3)
            index = self._turning_index(poses, (clearance > 0.0) | rising, costmap, turning_distance)
            if index is not None and (best is None or index < best[0]):
                best = index, poses[index, :2], direction < 0.0
        return None if best is None else best[1:]

    def _approach(self, goal: Pose2D, costmap: Costmap, turning_distance: float) -> NDArray[np.float64] | None:
        """A point (2,) straight behind the goal where the base can turn."""
        poses = self._straight(goal, -1.0)
        index = self._turning_index(poses, costmap.footprint_clearance(poses) > 0.0, costmap, turning_distance)
        return None if index is None else poses[index, :2]

    def _turning_index(
        self, poses: NDArray[np.float64], free: NDArray[np.bool_], costmap: Costmap, turning_distance: float
    ) -> int | None:
        """Which of the poses (N, 3) along a straight piece to turn at; 0 if the base can turn at its end already."""
        turns = (costmap.distance_at(poses[:, :2]) >= turning_distance) & np.logical_and.accumulate(free)
        if not turns.any():
            return None
        first = int(np.argmax(turns))
        wanted = round(self._parameters.straight / self._parameters.step)
        if first == 0 or first >= wanted:
            return first
        return int(np.flatnonzero(turns[: wanted + 1])[-1])

    def _straight(self, pose: Pose2D, direction: float) -> NDArray[np.float64]:
        """Poses (N, 3) straight ahead of (1.0) or behind (-1.0) a pose, itself first."""
        along = direction * np.arange(0.0, self._parameters.max_straight, self._parameters.step)
        heading = np.full_like(along, pose.theta)
        return np.column_stack([pose.x + along * math.cos(pose.theta), pose.y + along * math.sin(pose.theta), heading])

    def _smooth(
        self, points: NDArray[np.float64], costmap: Costmap, lethal_distance: float, slack: float
    ) -> NDArray[np.float64]:
        """The cheapest polyline through some of ``points`` (N, 2) that keeps the first and the last."""
        count = min(len(points), self._parameters.vertex_limit)
        kept = np.unique(np.linspace(0, len(points) - 1, count).round().astype(int))
        vertices = points[kept]
        best = np.full(len(vertices), np.inf)
        best[0] = 0.0
        previous = np.zeros(len(vertices), dtype=int)
        # Where even the next vertex cannot be reached straight, the grid path between the two is taken as it is.
        by_grid = np.zeros(len(vertices), dtype=bool)
        for i in range(len(vertices) - 1):
            cost = _segment_costs(vertices[i], vertices[i + 1 :], costmap, lethal_distance, slack)
            cost += best[i] + self._parameters.turn_cost
            if not np.isfinite(cost[0]):
                length = np.linalg.norm(np.diff(points[kept[i] : kept[i + 1] + 1], axis=0), axis=1).sum()
                cost[0] = best[i] + 10.0 * length
                by_grid[i + 1] = cost[0] < best[i + 1]
            better = cost < best[i + 1 :]
            best[i + 1 :][better] = cost[better]
            previous[i + 1 :][better] = i
        pieces = [points[-1:]]
        j = len(vertices) - 1
        while j != 0:
            i = int(previous[j])
            pieces.append(points[kept[i] : kept[j]] if by_grid[j] and i == j - 1 else points[kept[i]][None])
            j = i
        return np.vstack(pieces[::-1])

    def _is_free(self, points: NDArray[np.float64], costmap: Costmap) -> bool:
        """Whether the footprint passes along a polyline (N, 2), turning at its corners, without touching."""
        deltas = np.diff(points, axis=0)
        headings = np.arctan2(deltas[:, 1], deltas[:, 0])
        poses = []
        for i, delta in enumerate(deltas):
            share = np.linspace(0.0, 1.0, max(2, math.ceil(float(np.linalg.norm(delta)) / self._parameters.step)))
            poses.append(np.column_stack([points[i] + share[:, None] * delta, np.full(len(share), headings[i])]))
            if i:
                turn = wrap_angle(headings[i] - headings[i - 1])
                between = headings[i - 1] + turn * np.linspace(0.0, 1.0, max(2, math.ceil(abs(turn) / 0.05)))
                poses.append(np.column_stack([np.broadcast_to(points[i], (len(between), 2)), between]))
        return bool(np.all(costmap.footprint_clearance(np.vstack(poses)) > 0.0)) if poses else True


def _segment_costs(
    start: NDArray[np.float64], ends: NDArray[np.float64], costmap: Costmap, lethal_distance: float, slack: float
) -> NDArray[np.float64]:
    """Cost (N,) of driving straight from ``start`` (2,) to each of ``ends`` (N, 2); infinite where it is blocked."""
    lengths = np.linalg.norm(ends - start, axis=1)
    count = max(2, math.ceil(float(lengths.max()) / (costmap.resolution / 2)))
    share = (np.arange(count + 1) / count)[None, :, None]
    samples = start + share * (ends - start)[:, None, :]
    costs = np.full(len(ends), np.inf)
    # Most segments are blocked, and a few of their samples tell.
    open_ones = np.flatnonzero(np.all(costmap.distance_at(samples[:, ::_SPARSE]) - lethal_distance >= -slack, axis=1))
    if len(open_ones):
        distance = costmap.distance_at(samples[open_ones])
        costs[open_ones] = costmap.cost(distance, lethal_distance, slack).mean(axis=1) * lengths[open_ones]
    return costs


def _joined(
    start: NDArray[np.float64], middle: NDArray[np.float64], goal: NDArray[np.float64], backwards: bool
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The whole path without repeated points, and which of its segments are driven backwards."""
    points = np.vstack([start, middle, goal])
    reverse = np.zeros(len(points) - 1, dtype=bool)
    reverse[0] = backwards
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6
    return points[np.append(True, moves)], reverse[moves]
